"""Files are written whole or not at all: to a temporary name beside the target, then renamed."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import CardError, InputError
from magfem.units import one_line


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to `path` in one step; raises InputError when the place cannot be written."""
    with _cannot_write(path):
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            os.chmod(name, 0o666 & ~_umask())
            os.replace(name, path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


def write_text(path: Path, content: str) -> None:
    """Write text as UTF-8 in one step."""
    write_bytes(path, content.encode())


def write_json(path: Path, data: Any) -> None:
    """Write JSON in one step; floats keep every bit, NaN and infinities are refused (ValueError)."""
    write_text(path, to_json(data) + "\n")


def to_json(data: Any) -> str:
    """JSON text of plain data and NumPy arrays; lists of numbers stand on one line."""
    text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False, default=_plain)
    return _NUMBERS.sub(lambda found: f"[{_BREAK.sub(' ', found[1])}]", text)


def not_whole(what: str, error: Exception, shown: str, key: str) -> CardError:
    """What to raise for a JSON file that does not hold a whole `what`, from the exception met while reading `key`.

    A ValueError's text says what was expected; `shown` is how messages name the file.
    """
    reason = f"{key} is not laid out as in a {what}"
    if isinstance(error, KeyError):
        reason = f"missing key {error}"
    elif isinstance(error, InputError):
        reason = str(error)
    elif isinstance(error, ValueError):
        reason = f"expected {error}"
    return CardError(f"not a whole {what}: {one_line(reason)}", f"{shown}: {key}" if key else shown)


_NUMBERS = re.compile(r"\[\n\s*([-+0-9.eE]+(?:,\n\s*[-+0-9.eE]+)*)\n\s*\]")  # texts hold no line breaks as such
_BREAK = re.compile(r"\n\s*")


def read_json(path: Path, what: str) -> Any:
    """Parsed JSON of a file; InputError says what is wrong with it. `what` names its content for people."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{what} not found [{path}]") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{what} cannot be read: {error} [{path}]") from None
    except json.JSONDecodeError as error:
        raise InputError(f"{what} is not valid JSON (line {error.lineno}: {error.msg}) [{path}]") from None
    except RecursionError:
        raise InputError(f"{what} is nested too deeply [{path}]") from None
    except ValueError:  # Python's own limit on the digits of an integer
        raise InputError(f"{what} holds a number of too many digits [{path}]") from None


def write_folder(path: Path, fill: Callable[[Path], None], owned: frozenset[str]) -> None:
    """Make or replace the folder `path` by what `fill` puts into an empty one.

    owned: the names that `fill` gives; a folder that holds any other is left alone (InputError).
    """
    check_folder(path, owned)
    path = path.resolve()  # a link to a folder stays, its target is replaced
    with _cannot_write(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        hidden = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        draft, old = hidden / "draft", hidden / "old"
        try:
            draft.mkdir()
            fill(draft)
            check_folder(path, owned)  # filling may have taken minutes
            if path.exists():
                os.replace(path, old)
            try:
                os.replace(draft, path)
            except BaseException:
                if old.exists():
                    os.replace(old, path)
                raise
        finally:
            if path.exists() or not old.exists():  # else the hidden folder holds the only copy
                shutil.rmtree(hidden, ignore_errors=True)


def check_folder(path: Path, owned: frozenset[str]) -> None:
    """Raise InputError unless `path` is free, or a folder that holds nothing but `owned` names."""
    with _cannot_write(path):
        foreign = sorted({child.name for child in path.iterdir()} - owned) if path.exists() else []
    if foreign:
        raise InputError(f"this folder holds other files ({foreign[0]}): choose another or an empty one [{path}]")


@contextmanager
def _cannot_write(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write: {error.strerror or error} [{path}]") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
