"""The exceptions that kybflow raises on purpose, and the exit codes of the command line.

    KybflowError
    ├── UnitError         a quantity can't be parsed in the expected dimension
    ├── FileError         a part can't use the file that a parameter names
    ├── PartError         a part is declared wrongly (a programmer's mistake)
    ├── Refused           a behavior can't start, or a vehicle refuses a request
    ├── EstimateMissing   a part needs an estimate and the vehicle has none
    ├── PartFailed        a part raised during a run
    ├── OptionRefused     a run-time option was not changed
    ├── EventRefused      an event was not emitted
    ├── CommandUnreadable an operator's command can't be parsed
    ├── CalibrationFailed the frames are not sufficient for a calibration
    └── DriverError       a driver, link or device failed

Mistakes in a mission are not exceptions: they are collected as diagnostics
(`kybflow.dsl.diagnostics`).
"""

from __future__ import annotations

from traceback import format_exception

FAILED = 1
"""The exit code of a command that failed or was refused, whose verdict is negative, or whose output
can't be written. 0 is success."""
INVALID = 2
"""The exit code if a mission or a command line is not valid, and nothing ran."""
DRIVER_FAILED = 3
"""The exit code if a vehicle or its emulator could not be reached or opened."""
INTERRUPTED = 130
"""The exit code if the user interrupted the command."""


class KybflowError(Exception):
    """Base class of every error that kybflow raises on purpose."""


class UnitError(KybflowError):
    """A quantity can't be parsed in its dimension. hint: what to write instead, or empty."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class FileError(KybflowError):
    """A part can't use the file that a parameter names. line: the line number from 1, or 0 for the
    whole file. hint: one line that says what to change, or empty."""

    def __init__(self, message: str, line: int = 0, hint: str = "") -> None:
        super().__init__(message)
        self.line = line
        self.hint = hint


class PartError(KybflowError):
    """A part is declared wrongly; raised when the part is loaded."""


class Refused(KybflowError):
    """A behavior can't start in the present situation, or a vehicle refuses a request (to arm, land
    or grip). The message says why."""


class EstimateMissing(KybflowError):
    """A part needs the vehicle's estimate, and no estimator provides one."""


class PartFailed(KybflowError):
    """A part raised an exception or returned an invalid value during a run. part: its label.
    traceback: where it raised."""

    def __init__(self, part: str, error: BaseException) -> None:
        super().__init__(described(error))
        self.part, self.traceback = part, traceback_of(error)


class OptionRefused(KybflowError):
    """A run-time option was not changed; the message says why."""


class EventRefused(KybflowError):
    """An operator's event was not emitted; the message says why."""


class CommandUnreadable(KybflowError):
    """An operator's command can't be parsed; the message says how to write it."""


class CalibrationFailed(KybflowError):
    """The recorded frames are not sufficient for a calibration; the message says why, and what to
    do."""


class DriverError(KybflowError):
    """A driver, a link or a device failed."""


def traceback_of(error: BaseException) -> str:
    """Return the traceback of an exception as text; empty for kybflow's own errors, whose messages
    are complete."""
    return "" if isinstance(error, KybflowError) else "".join(format_exception(error))


def described(error: BaseException) -> str:
    """Return an exception in one line: its type and, if it has one, its message."""
    name = type(error).__name__
    return f"{name}: {error}" if str(error) else name
