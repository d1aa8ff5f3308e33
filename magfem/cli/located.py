"""Windows of samples, localized one after the other or as a track: what `magfem localize` finds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from magfem.errors import ConvergenceError, InputError

if TYPE_CHECKING:
    from magfem.localization import Pose
    from magfem.localization.live_track import LiveTrack
    from magfem.localization.recorded import Setup
    from magfem.samples.recording import Recording, Windows


class Located:
    """Poses of one window after the other, as plain data; what gave none with the reason.

    With a prior, every window takes the branch nearest to the pose before it. entries, left_out: plain data, as
    `poses_file` has it.  last: the poses of the last window that gave any.
    """

    def __init__(self, setup: Setup, near: Sequence[Any] | None) -> None:
        self.setup, self.near = setup, near
        self.entries: list[dict[str, Any]] = []
        self.left_out: list[dict[str, Any]] = []
        self.last: tuple[Pose, ...] = ()

    def add(self, piece: Recording, start: float, length: float, fatal: bool = False) -> list[dict[str, Any]]:
        """The poses of a window, one for every motor; none when it gives none, or the error itself if `fatal`."""
        from magfem.localization.poses_file import pose_to_dict

        time = start + length / 2
        try:
            poses, names = self.poses(piece)
        except (InputError, ConvergenceError) as error:
            if fatal:
                raise
            self.left_out.append({"time": time, "reason": str(error)})
            return []
        found = [pose_to_dict(pose, time, (start, start + length), names) for pose in poses]
        self.entries += found
        self.last = poses
        if self.near is not None:
            self.near = poses
        return found

    def follow(self, piece: Recording, start: float, live: LiveTrack) -> list[dict[str, Any]]:
        """What is believed after one more window of a track; nothing when it gives none."""
        from magfem.localization.poses_file import belief_to_dict

        length = live.windows.length
        try:
            belief, names = live.add(piece, start)
        except (InputError, ConvergenceError) as error:
            self.left_out.append({"time": start + length / 2, "reason": str(error)})
            return []
        self.entries.append(belief_to_dict(belief, (start, start + length), names))
        return self.entries[-1:]

    def poses(self, piece: Recording) -> tuple[tuple[Pose, ...], tuple[str, ...]]:
        """The poses of a window, and the names of the sensors that took part. Raises InputError, ConvergenceError."""
        from magfem.localization.recorded import localize_recording

        return localize_recording(piece, self.setup, self.near)

    def track(self, recording: Recording, windows: Windows) -> None:
        """All windows of a recording as one track. Raises InputError, ConvergenceError."""
        from magfem.localization.poses_file import track_to_dicts
        from magfem.localization.recorded import track_recording

        length = windows.length
        near = self.near[0] if self.near else None
        found, starts, missed, names = track_recording(recording, self.setup, length, windows.step, near)
        self.entries = track_to_dicts(found, starts, length, names)
        self.left_out = [{"time": start + length / 2, "reason": "too few samples"} for start in missed.tolist()]

    def look_again(self, recording: Recording) -> None:
        """The last window of a track for itself, as pictures show it. Raises InputError, ConvergenceError."""
        begin, end = self.entries[-1]["window"]
        piece = recording.subset((recording.times >= begin) & (recording.times < end))
        self.near = [self.entries[-1]["position"]]
        self.last, _ = self.poses(piece)
