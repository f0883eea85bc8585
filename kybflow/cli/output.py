"""Prints the output of the commands: in colour on a terminal, and to streams that may be closed at
their other end."""

from __future__ import annotations

import functools
import os
import re
import select
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING, Any, TextIO, TypeVar, cast

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

Key = TypeVar("Key")
Value = TypeVar("Value")
_STYLES = (
    (r"(?m)^.*error\[KYB\d+\]:.*$", "bold"),
    (r"error\[KYB\d+\]", "bold red"),
    (r"warning\[KYB\d+\]", "bold yellow"),
    (r"(?m)^ {6}\| .*$", "red"),
    (r"(?m)^ +\d+ \|| {6}[|=]", "blue"),
    (r"\bhelp:", "green"),
    (r"(?m)^(?:held|green)\b|^\S+ succeeded$|\bpreflight: \d+ checks passed$", "green"),
    (r"(?m)^(?:FAILED|DRIVER_FAILED|INVALID|RED)\b", "bold red"),
    (r"(?m)^\S+ (?:driver )?FAILED\b|^error:|\b\w+_failed\b", "bold red"),
    (r"(?m)^\S+ interrupted\b|^warning:|\bfailsafe_started\b", "bold yellow"),
)


class Unwritable(OSError):
    """The output of a command can't be written."""


class GuardedStream:
    """A stream that drops all output after its first error. A reader that goes away (`| head`) or a
    full disk thus neither ends a flight nor changes its exit code. An error that is not of the type
    `ignored` raises Unwritable."""

    def __init__(self, stream: IO[str], ignored: type[OSError] = OSError) -> None:
        self._stream, self._ignored = stream, ignored

    def write(self, text: str) -> int:
        if text == "":  # click's probe for text, whose error click would swallow
            return 0
        try:
            return self._stream.write(text)
        except OSError as error:
            self._drain(error)
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError as error:
            self._drain(error)

    def _drain(self, error: OSError) -> None:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)
        if not isinstance(error, self._ignored):
            raise Unwritable(error.errno, error.strerror) from None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class UnwaitedStream:
    """A stream for use in flight: whoever writes to it never waits for its reader and never gets an
    error.

    A thread writes to the file descriptor. While `_MOST_WAITING` characters wait, because the
    terminal is stopped (Ctrl-S) or its connection hangs, further text is dropped; after an error,
    all of it is. Leaving the context waits until everything is written.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._descriptor: int | None = None
        with suppress(OSError):  # a stream in memory has no descriptor
            self._descriptor = stream.fileno()
        self._waiting: deque[str] = deque()
        self._size = 0
        self._changed = threading.Condition()
        self._ends = False
        self._writer = threading.Thread(target=self._write_all, name="output", daemon=True)

    def __enter__(self) -> UnwaitedStream:
        self._stream.flush()
        self._writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._ends = True
            self._changed.notify()
        self._writer.join()

    def write(self, text: str) -> int:
        with self._changed:
            if self._size + len(text) <= _MOST_WAITING:
                self._waiting.append(text)
                self._size += len(text)
                self._changed.notify()
        return len(text)

    def line(self, text: str) -> None:
        self.write(f"{_for(self._stream, text)}\n")

    def flush(self) -> None:
        """Do nothing: the thread writes as soon as it can."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _write_all(self) -> None:
        is_open = True
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ends)
                if not self._waiting:
                    return
                text = self._waiting.popleft()
            try:
                if is_open:
                    self._put(text)
            except OSError:
                is_open = False
            with self._changed:
                self._size -= len(text)

    def _put(self, text: str) -> None:
        """Write to the descriptor, if there is one. Python's own buffer has a lock, and while this
        thread held it, the main thread could neither print nor exit."""
        if self._descriptor is None:
            self._stream.write(text)
            return
        data = memoryview(text.encode(self._stream.encoding, "replace"))
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:  # another program has made the terminal non-blocking
                select.select([], [self._descriptor], [])


_MOST_WAITING = 1 << 18


def echo(text: str, err: bool = False) -> None:
    """Print `text`, in colour on a terminal."""
    stream = sys.stderr if err else sys.stdout
    stream.write(f"{_for(stream, text)}\n")


def _for(stream: IO[str], text: str) -> str:
    """Return `text`, in colour if the stream is a terminal, unless NO_COLOR is set."""
    return coloured(text) if stream.isatty() and not os.environ.get("NO_COLOR") else text


def grouped(pairs: Iterable[tuple[Key, Value]]) -> dict[Key, list[Value]]:
    """Group values by key, in order."""
    groups: dict[Key, list[Value]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def columns(rows: Iterable[Sequence[str]], indent: str = "") -> list[str]:
    """Format rows of cells as lines with aligned columns; the last cell of a row is not padded."""
    cells = list(rows)
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)][:-1]
    filled = ([*(f"{c:<{w}}" for c, w in zip(r, widths, strict=False)), r[-1]] for r in cells)
    return [indent + "  ".join(row) for row in filled]


def printer(stream: IO[str]) -> Callable[[str], None]:
    """Return a function that prints a line and never raises an error of the stream, for use in
    flight."""
    guarded = GuardedStream(stream)

    def write(line: str) -> None:
        guarded.write(f"{_for(stream, line)}\n")
        guarded.flush()

    return write


@contextmanager
def notices() -> Iterator[None]:
    """While entered, print to stderr what the simulator logs about its own work, if a person reads
    it there."""
    import logging  # which a command that flies nothing does without

    if not sys.stderr.isatty():
        yield
        return
    with UnwaitedStream(sys.stderr) as stream:
        logger, handler = logging.getLogger("kybflow"), logging.StreamHandler(stream)
        level = logger.level
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        try:
            yield
        finally:
            logger.setLevel(level)
            logger.removeHandler(handler)


def console(stream: IO[str] | UnwaitedStream) -> Console:
    """Return a console that never raises an error of the stream, for use in flight."""
    from rich.console import Console

    return Console(file=cast(IO[str], GuardedStream(cast(IO[str], stream))), emoji=False)


def coloured(text: str) -> str:
    """Add colour codes to findings and to the lines of a run."""
    console = _colouring()
    with console.capture() as capture:
        console.print(styled(text), end="", soft_wrap=True)
    return capture.get()


@functools.cache
def _colouring() -> Console:
    from rich.console import Console

    return Console(force_terminal=True, highlight=False)


def styled(text: str) -> Text:
    """Return findings, or the lines of a run, with their styles."""
    from rich.text import Text

    found = Text(text)
    for pattern, style in _STYLES:
        for match in re.finditer(pattern, text):
            found.stylize(style, *match.span())
    return found
