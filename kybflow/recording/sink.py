"""Where a recording goes: a file whose errors never reach the tick."""

from __future__ import annotations

from io import FileIO
from pathlib import Path


class Sink:
    """The file, unbuffered, so that what is written survives this program.

    An error is kept in `failed` and ends the recording: what comes later is dropped. The writer
    never sees it, because it would print it. Raises OSError when the file can't be opened.
    """

    def __init__(self, path: Path) -> None:
        self._file = FileIO(path, "w")
        self._size = 0
        self.failed: str | None = None

    def write(self, data: bytes) -> int:
        left = memoryview(data)
        try:
            while left and self.failed is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self.failed = f"the recording stopped: {error.strerror or error}"
        self._size += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Where the file ends; with seeking disabled the SDK only asks for that."""
        return self._size

    def flush(self) -> None:
        """There is nothing to flush: the file is unbuffered."""

    def close(self) -> None:
        try:
            self._file.close()
        except OSError as error:
            self.failed = self.failed or f"the recording stopped: {error.strerror or error}"
