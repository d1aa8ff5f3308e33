"""Compiled kernels: one decorator, and a cache that knows when any kernel's source has changed.

Numba's own cache looks only at the file of the function that is called, so an edited callee in another file
would go unnoticed. Here the cache folder carries a hash of all of magfem's sources that hold kernels, lies in
the user's cache folder (an installed package may be read-only) and is safe to share between processes.
"""

from __future__ import annotations

import hashlib
import logging
import os
import stat
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event

log = logging.getLogger("magfem")
Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile `function` to machine code on first use; the result is kept for later processes.

    The kernel releases the interpreter lock, so that threads can share its work, and divides by zero as IEEE
    arithmetic does (infinite fields on wires) instead of raising.
    """
    return _compile(function, fastmath=False)


def summing_kernel(function: Function) -> Function:
    """A kernel whose sums may be taken in any order, so that they use the processor's vector units."""
    return _compile(function, fastmath={"reassoc", "contract", "nsz", "arcp"})


def _compile(function: Function, fastmath: Any) -> Function:
    folder = cache_folder()
    config: Any = numba.config
    previous, config.CACHE_DIR = config.CACHE_DIR, str(folder or "")
    try:
        jit: Any = numba.njit(cache=folder is not None, nogil=True, error_model="numpy", fastmath=fastmath)
        compiled = jit(function)
    finally:
        config.CACHE_DIR = previous
    return cast(Function, compiled)


class _Announcement(event.Listener):
    """Says so, once, when a kernel of ours has to be compiled because no cached one fits."""

    said = False

    def on_start(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if not self.said and dispatcher.py_func.__module__.startswith("magfem."):
            self.said = True
            log.info("first use on this machine: compiling kernels, once, up to 40 s")

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


event.register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]


@cache
def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None when no place can be written that nobody else may write to."""
    package = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        if b"magfem.compiled import" in text:
            digest.update(text)
    for place in (_users_folder, _temporary_folder):
        try:
            folder = place() / digest.hexdigest()[:16]
            folder.mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError):  # RuntimeError: a user without a home
            continue
        if os.access(folder, os.W_OK):
            return folder
    log.warning("no folder can be written to keep compiled kernels in: they are compiled anew in every process")
    return None


def _users_folder() -> Path:
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "magfem"


def _temporary_folder() -> Path:
    """A folder of this user alone: machine code that others could write must not be run."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"magfem-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if hasattr(os, "getuid") and (found.st_uid != user or stat.S_IMODE(found.st_mode) != 0o700 or folder.is_symlink()):
        raise PermissionError(f"not a private folder [{folder}]")
    return folder
