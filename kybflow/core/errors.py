"""Every exception that kybflow raises on purpose.

KybflowError
├── UnitError       a quantity that can't be read: what was found, what was expected
├── FileError       a file of a parameter that its part can't use: which line, and why
├── PartError       a part whose declaration is wrong (a programmer's mistake)
├── Refused         a part that can't start, with the reason
├── EstimateMissing a part asked for an estimate where there is none
├── PartFailed      a part that raised in a run: which, and what
├── OptionRefused   a change of an option that was not made, with the reason
├── EventRefused    an event that was not told, with the reason
└── DriverError     a driver or device that failed

Mistakes in a mission are not exceptions: they are collected as diagnostics
(`kybflow.dsl.diagnostics.diagnostic`).
"""

from __future__ import annotations


class KybflowError(Exception):
    """The root of every error that kybflow raises on purpose."""


class UnitError(KybflowError):
    """A quantity that can't be read in the dimension that its place asks for.

    `hint` is the way out, one line, or empty.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class FileError(KybflowError):
    """A file that a parameter names and that the part can't use. `line` counts from 1, 0 stands for
    the whole file; `hint` is the way out, one line, or empty."""

    def __init__(self, message: str, line: int = 0, hint: str = "") -> None:
        super().__init__(message)
        self.line = line
        self.hint = hint


class PartError(KybflowError):
    """A part whose declaration is wrong; raised when the part is loaded."""


class Refused(KybflowError):
    """Raised from a behavior's constructor: it can't start here, and why."""


class EstimateMissing(KybflowError):
    """A part asked for the vehicle's estimate where no estimator has one."""


class PartFailed(KybflowError):
    """A part that raised, or gave what no part may give, in a run. `part` is its label."""

    def __init__(self, part: str, error: Exception) -> None:
        super().__init__(described(error))
        self.part = part


class OptionRefused(KybflowError):
    """A change of a run-time option that was not made, and why."""


class EventRefused(KybflowError):
    """An event from the command line that was not told, and why."""


class DriverError(KybflowError):
    """A driver, a link or a device that failed."""


def described(error: Exception) -> str:
    """Any exception in one line: its type, and what it says."""
    name = type(error).__name__
    return f"{name}: {error}" if str(error) else name
