"""Standard output whose reader may go away."""

from __future__ import annotations

import os
from typing import IO, Any


class Unwritable(OSError):
    """Output that can't be written, and must have been."""


class Outlet:
    """A stream that goes nowhere from the first error on. One that is `lost` is nobody's concern: a
    reader that has gone (`| head`), or a full disk while something flies, must not end, or change
    the exit code of, what is being done. Any other is raised, once, as Unwritable."""

    def __init__(self, stream: IO[str], lost: type[OSError] = OSError) -> None:
        self._stream, self._lost = stream, lost

    def write(self, text: str) -> int:
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
        if not isinstance(error, self._lost):
            raise Unwritable(error.errno, error.strerror) from None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
