"""Every error that magfem raises on purpose.

Each message is one sentence that says what is wrong, where, what was expected and, where it helps, the mend.
The command line turns them into one line on stderr and the exit code that the class carries.
"""

from __future__ import annotations


class MagfemError(Exception):
    """Base of all errors raised on purpose; `exit_code` is what the command line returns for it."""

    exit_code = 3


class InputError(MagfemError):
    """What the user gave cannot be used: a card, a file, an argument, an array of the wrong shape."""

    exit_code = 2


class CardError(InputError):
    """A device card, recipe or model file is wrong; `where` names the file and the key."""

    def __init__(self, message: str, where: str) -> None:
        self.where = where
        super().__init__(f"{message} [{where}]")


class OutsideRegionError(InputError):
    """A field was asked for at points where its model makes no promise."""


class UnitMismatchError(InputError):
    """Fields in T and fields in T/A were mixed, or a field was scaled that does not scale."""


class MissingProgramError(InputError):
    """A program or shared library outside Python is needed and absent; the message holds the line to type."""


class MeshError(MagfemError):
    """The mesh does not represent the geometry: wrong volume, inverted elements, lost bodies."""


class ConvergenceError(MagfemError):
    """An iteration ended without reaching its tolerance; the message holds the residual."""
