"""Standard output whose reader may go away."""

from __future__ import annotations

import os
from typing import IO, Any


class Outlet:
    """A stream that goes nowhere from the first error `lost` on: a reader that has gone (`| head`)
    or a disk that is full must not end, or change the exit code of, what is being done."""

    def __init__(self, stream: IO[str], lost: type[OSError] = OSError) -> None:
        self._stream, self._lost = stream, lost

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except self._lost:
            self._drain()
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except self._lost:
            self._drain()

    def _drain(self) -> None:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
