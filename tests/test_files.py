"""Files appear whole or not at all, whatever interrupts the writing."""

from __future__ import annotations

import json
import os
import stat

import numpy as np
import pytest

from magfem import files
from magfem.errors import InputError
from magfem.files import read_json, to_json, write_bytes, write_folder, write_json, write_text


def entries(folder) -> set[str]:
    """Names in a folder, hidden ones too."""
    return set(os.listdir(folder))


OWNED = frozenset({"a.txt", "deep"})


def fill(folder) -> None:
    (folder / "a.txt").write_text("new")
    (folder / "deep").mkdir()
    (folder / "deep" / "b.txt").write_text("new")


@pytest.fixture
def umask():
    """Sets the process's mask; the old one comes back."""
    before = os.umask(0)
    os.umask(before)
    yield os.umask
    os.umask(before)


WRITERS = {
    "bytes": lambda path: write_bytes(path, b"new"),
    "text": lambda path: write_text(path, "new"),
    "json": lambda path: write_json(path, {"new": 1}),
}
writers = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)


def test_content_is_what_was_written(tmp_path):
    write_bytes(tmp_path / "a", b"\x00\xff\r\n")
    write_text(tmp_path / "b", "µ₀ × 4 mm\n")
    assert (tmp_path / "a").read_bytes() == b"\x00\xff\r\n"
    assert (tmp_path / "b").read_bytes() == "µ₀ × 4 mm\n".encode()
    assert entries(tmp_path) == {"a", "b"}


@writers
def test_existing_file_is_replaced(write, tmp_path):
    (tmp_path / "file").write_text("old and longer than the new one")
    write(tmp_path / "file")
    assert "old" not in (tmp_path / "file").read_text() and entries(tmp_path) == {"file"}


# Interruptions


@writers
@pytest.mark.parametrize("step", ["replace", "chmod", "fdopen"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), MemoryError()])
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_interrupted_write_leaves_the_old_file_alone(write, step, error, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("old")

    def interrupted(*arguments, **keywords):
        raise error

    with monkeypatch.context() as patch, pytest.raises((InputError, type(error))) as caught:
        patch.setattr(files.os, step, interrupted)
        write(tmp_path / "file")
    if isinstance(error, OSError):
        assert type(caught.value) is InputError
        assert str(caught.value) == f"cannot write: No space left on device [{tmp_path / 'file'}]"
    assert (tmp_path / "file").read_text() == "old" and entries(tmp_path) == {"file"}


def test_content_that_cannot_be_encoded_leaves_the_old_file_alone(tmp_path):
    (tmp_path / "file").write_text("old")
    for write, error in (
        (lambda path: write_text(path, "\ud800"), UnicodeEncodeError),
        (lambda path: write_json(path, {"x": float("nan")}), ValueError),
        (lambda path: write_json(path, {"x": np.array([1.0, np.inf])}), ValueError),
        (lambda path: write_json(path, {"x": object()}), TypeError),
    ):
        with pytest.raises(error):
            write(tmp_path / "file")
        assert (tmp_path / "file").read_text() == "old" and entries(tmp_path) == {"file"}


@writers
def test_missing_folder_is_one_sentence(write, tmp_path):
    with pytest.raises(InputError, match=r"^cannot write: No such file or directory \[.*absent/file\]$"):
        write(tmp_path / "absent" / "file")
    assert entries(tmp_path) == set()


@writers
def test_folder_in_place_of_a_file_is_one_sentence(write, tmp_path):
    (tmp_path / "file").mkdir()
    with pytest.raises(InputError, match=r"^cannot write: Is a directory"):
        write(tmp_path / "file")
    assert entries(tmp_path) == {"file"}


@writers
def test_file_in_place_of_a_folder_is_one_sentence(write, tmp_path):
    (tmp_path / "file").write_text("old")
    with pytest.raises(InputError, match=r"^cannot write: Not a directory"):
        write(tmp_path / "file" / "inner")
    assert (tmp_path / "file").read_text() == "old"


@writers
def test_read_only_folder_is_one_sentence(write, tmp_path, monkeypatch):
    """To root nothing is read-only: the refusal is then played by the system call itself."""
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    if os.access(closed, os.W_OK):

        def refused(*arguments, **keywords):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(files.tempfile, "mkstemp", refused)
    with pytest.raises(InputError, match=r"^cannot write: Permission denied"):
        write(closed / "file")
    assert entries(closed) == set()


# Rights


@pytest.mark.parametrize(("mask", "file_mode", "folder_mode"), [(0o022, 0o644, 0o755), (0o077, 0o600, 0o700)])
def test_umask_is_respected(mask, file_mode, folder_mode, tmp_path, umask):
    umask(mask)
    write_text(tmp_path / "file", "new")
    write_folder(tmp_path / "folder", fill, OWNED)
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == file_mode
    assert stat.S_IMODE((tmp_path / "folder").stat().st_mode) == folder_mode
    assert umask(0) == mask  # and left as it was


# Folders


def test_folder_is_made_with_its_parents(tmp_path):
    write_folder(tmp_path / "one" / "two", fill, OWNED)
    assert entries(tmp_path / "one") == {"two"} and entries(tmp_path / "one" / "two") == {"a.txt", "deep"}


def test_folder_is_replaced_as_a_whole(tmp_path):
    """Nothing of the old content stays between the new."""
    (tmp_path / "run" / "deep" / "old").mkdir(parents=True)
    (tmp_path / "run" / "a.txt").write_text("old")
    write_folder(tmp_path / "run", fill, OWNED)
    assert entries(tmp_path / "run") == {"a.txt", "deep"} and (tmp_path / "run" / "a.txt").read_text() == "new"
    assert entries(tmp_path / "run" / "deep") == {"b.txt"} and entries(tmp_path) == {"run"}


def test_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "proj").mkdir()
    for name in ("a.txt", "thesis.tex"):
        (tmp_path / "proj" / name).write_text("old")
    message = rf"^this folder holds other files \(thesis.tex\): choose another or an empty one \[{tmp_path}/proj\]$"
    with pytest.raises(InputError, match=message):
        write_folder(tmp_path / "proj", fill, OWNED)
    assert (tmp_path / "proj" / "a.txt").read_text() == "old" and entries(tmp_path / "proj") == {"a.txt", "thesis.tex"}
    assert entries(tmp_path) == {"proj"}


def test_file_put_there_while_filling_is_left_alone(tmp_path):
    (tmp_path / "run").mkdir()

    def slow(folder):
        (tmp_path / "run" / "thesis.tex").write_text("old")

    with pytest.raises(InputError, match=r"thesis\.tex"):
        write_folder(tmp_path / "run", slow, OWNED)
    assert entries(tmp_path) == {"run"} and entries(tmp_path / "run") == {"thesis.tex"}


@pytest.mark.parametrize("error", [ValueError("bad"), KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_interrupted_filling_leaves_the_old_folder_alone(error, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "a.txt").write_text("old")

    def interrupted(folder):
        fill(folder)
        raise error

    with pytest.raises(InputError if isinstance(error, OSError) else type(error)):
        write_folder(tmp_path / "run", interrupted, OWNED)
    assert entries(tmp_path) == {"run"} and (tmp_path / "run" / "a.txt").read_text() == "old"
    with pytest.raises(InputError if isinstance(error, OSError) else type(error)):
        write_folder(tmp_path / "fresh", interrupted, OWNED)
    assert entries(tmp_path) == {"run"}


@pytest.mark.parametrize("failing", [1, 2])
def test_folder_survives_a_replacement_that_fails(failing, tmp_path, monkeypatch):
    """The old folder is moved away, then the new one into its place: whichever fails, the old one is there."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "a.txt").write_text("old")
    calls, replace = [], os.replace

    def sometimes(source, target):
        calls.append(source)
        if len(calls) == failing:
            raise OSError(5, "Input/output error")
        replace(source, target)

    with monkeypatch.context() as patch, pytest.raises(InputError, match=r"^cannot write: Input/output error"):
        patch.setattr(files.os, "replace", sometimes)
        write_folder(tmp_path / "run", fill, OWNED)
    assert len(calls) >= failing
    assert (tmp_path / "run" / "a.txt").read_text() == "old"
    assert entries(tmp_path) == {"run"}


def test_file_in_place_of_the_folder_is_one_sentence(tmp_path):
    (tmp_path / "run").write_text("old")
    with pytest.raises(InputError, match=r"^cannot write: "):
        write_folder(tmp_path / "run", fill, OWNED)
    assert (tmp_path / "run").read_text() == "old" and entries(tmp_path) == {"run"}


# JSON


def test_json_keeps_every_bit(tmp_path):
    rng = np.random.default_rng(1)
    numbers = rng.integers(0, 2**63, 2000).view(np.float64)
    numbers = np.concatenate([numbers[np.isfinite(numbers)], [0.0, -0.0, 5e-324, 1.7976931348623157e308, 0.1]])
    write_json(tmp_path / "x.json", {"numbers": numbers, "whole": np.int64(7), "yes": np.True_, "µ": "µ₀"})
    again = read_json(tmp_path / "x.json", "the numbers")
    assert np.array(again["numbers"]).tobytes() == numbers.tobytes()
    assert (again["whole"], again["yes"], again["µ"]) == (7, True, "µ₀")
    assert (tmp_path / "x.json").read_text(encoding="utf-8").endswith("\n")
    assert json.loads(to_json([np.float32(0.5)])) == [0.5]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, float("nan"), np.array([0.0, np.nan]), {"deep": [np.inf]}])
def test_json_refuses_what_json_does_not_have(value):
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json({"x": value})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"^the model not found \["),
        (b"{", r"^the model is not valid JSON \(line 1: "),
        (b'{\n"a": 1,\n', r"\(line 3: "),
        (b"", r"\(line 1: "),
        (b"\xff", "^the model cannot be read: "),
        (b"[" * 100_000, "^the model "),
        (b"1" * 5000, "^the model "),
    ],
)
def test_unreadable_json_is_one_sentence(content, message, tmp_path):
    if content is not None:
        (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_json(tmp_path / "x.json", "the model")
    assert len(str(caught.value).splitlines()) == 1 and str(caught.value).endswith(f"[{tmp_path / 'x.json'}]")
