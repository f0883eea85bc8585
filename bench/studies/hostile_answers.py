"""What the command line answers to an input that means harm, and what is wrong with that."""

from __future__ import annotations

import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import process_time
from types import FrameType
from typing import NamedTuple

from typer.testing import CliRunner

from kybflow.cli.app import app
from kybflow.cli.output import Unwritable
from kybflow.core.errors import DRIVER_FAILED, FAILED, INTERRUPTED, INVALID, KybflowError
from studies.hostile_inputs import LASTING, Hostile, laid

CODES = frozenset({0, FAILED, INVALID, DRIVER_FAILED, INTERRUPTED})
BUSY = 6
"""How much longer an answer may take by the clock than of the processor."""
LASTS = 1.0
"""Seconds after which a flight or a server is interrupted."""


class Answer(NamedTuple):
    """The exit code, the processor's seconds that it took, what was printed or raised, and what is
    wrong."""

    code: int
    seconds: float
    text: str
    wrong: str


class Late(BaseException):
    """No answer in time; nothing in a program catches it."""


@contextmanager
def _limited(first: float | None, then: float) -> Iterator[None]:
    """Interrupt after `first` seconds, unless that is None, and raise Late `then` seconds later."""
    left = [first is not None]

    def over(_number: int, frame: FrameType | None) -> None:
        if left.pop() if left else False:
            signal.setitimer(signal.ITIMER_REAL, then)
            raise KeyboardInterrupt
        raise Late("".join(traceback.format_stack(frame)))

    before = signal.signal(signal.SIGALRM, over)
    signal.setitimer(signal.ITIMER_REAL, first or then)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def answer(one: Hostile, folder: Path, long: float, lasts: float = LASTS) -> Answer:
    """What `kybflow` answers to an input in the folder, which is the current one.

    long: the processor's seconds that no answer may take, and on a busy machine a sixth of those by
    the clock; of a flight or a server, after its interrupt, which comes after `lasts` seconds.
    """
    with laid(one, folder):
        return _answered(one, long, lasts)


def _answered(one: Hostile, long: float, lasts: float) -> Answer:
    began = process_time()
    first = lasts if one.arguments[0] in LASTING else None
    try:
        with _limited(first, BUSY * long):
            result = CliRunner().invoke(app, [*one.arguments], prog_name="kybflow")
    except Late as late:
        return Answer(0, process_time() - began, str(late), f"no answer in {BUSY * long:g} s")
    except KeyboardInterrupt:
        return Answer(INTERRUPTED, process_time() - began, "", "")
    seconds, raised, code = process_time() - began, result.exception, result.exit_code
    text, wrong = result.output, ""
    if isinstance(raised, KybflowError | Unwritable):  # `main` says it in a sentence
        code = INVALID
    elif raised is not None and not isinstance(raised, SystemExit):
        text = "".join(traceback.format_exception(raised))
        wrong = f"raised {raised!r:.200}"
    elif code not in CODES:
        wrong = f"exit code {code}"
    elif seconds > long + (first or 0.0):
        wrong = f"took {seconds:.1f} s"
    return Answer(code, seconds, text, wrong)
