"""A track while samples come: what is believed of a magnet after every window, with process noise that is learned."""

from __future__ import annotations

import logging

from magfem.errors import ConvergenceError, InputError
from magfem.localization.following import Belief, follow_pose
from magfem.localization.motion import ProcessNoise
from magfem.localization.recorded import Setup, localize_recording, track_recording
from magfem.localization.tracking import START
from magfem.samples.recording import Recording, Windows, joined
from magfem.typing import ArrayLike

log = logging.getLogger("magfem")

FIRST_LOOK = 8  # windows after which process noise is found for the first time, then whenever they have doubled
REMEMBERED = 128  # windows, beyond which what is learned about process noise hardly changes


class LiveTrack:
    """One magnet followed from window to window of recordings that share a clock.

    belief: what is believed after the last window, None before the first.  noise: the process noise, found by `track`
    from the windows so far; until there are some, that of a magnet that moves slowly.
    """

    def __init__(self, setup: Setup, windows: Windows, near: ArrayLike | None = None) -> None:
        setup.check_track()
        if windows.step < windows.length:
            raise InputError(
                f"windows of a track must not overlap, their samples would count twice: a window of {windows.length:g} "
                f"s every {windows.step:g} s"
            )
        self.setup, self.windows, self.near = setup, windows, near
        self.belief: Belief | None = None
        self.noise: ProcessNoise = START
        self._pieces: list[Recording] = []

    def add(self, piece: Recording, start: float) -> tuple[Belief, tuple[str, ...]]:
        """What is believed after the window that begins at `start` (s), and the names of the sensors that took part.

        Raises InputError and ConvergenceError for a window that gives no pose; the belief is then as before.
        """
        (pose,), names = localize_recording(piece, self.setup, [self.near] if self.belief is None else None)
        sensors = [self.setup.sensor(name) for name in names]
        time = start + 0.5 * self.windows.length
        first = self.near if self.belief is None else None
        self.belief = follow_pose(self.belief, pose, time, self.setup.rotor, sensors, noise=self.noise, near=first)
        if len(self._pieces) < REMEMBERED:
            self._pieces.append(piece)
            self._learn()
        return self.belief, names

    def _learn(self) -> None:
        """Process noise from all windows so far, where their number is one at which to look."""
        count = len(self._pieces)
        if count < FIRST_LOOK or count & (count - 1):
            return
        try:
            found, *_ = track_recording(joined(self._pieces), self.setup, self.windows.length, self.windows.step)
        except (InputError, ConvergenceError):  # uneven samples, say: what is known so far must do
            log.info("track: %d windows tell no process noise, that so far is kept", count)
            return
        self.noise = found.noise
        log.info(
            "track: process noise %.2g m²/s³ of the position, %.2g rad²/s³ of the axis, from %d windows",
            *(self.noise.position, self.noise.axis, count),
        )
