"""A file that grows while a run is flying."""

from __future__ import annotations

import os
from io import FileIO
from pathlib import Path
from stat import S_ISREG


class GrowingFile:
    """An unbuffered file that a run appends to, so that its contents survive a crash.

    After the first error, `failed` holds the reason and further data is dropped. It counts as an
    error if another program removes, replaces or truncates the file. what: a name for the contents,
    used in `failed`. Raises OSError if the file can't be opened.
    """

    def __init__(self, path: Path, what: str) -> None:
        self._path, self._what = path, what
        # appends, because writing at a position would fill a truncated file up with zeros
        self._file = FileIO(
            path, "w", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666)
        )
        self._size = 0
        self.failed: str | None = None

    def write(self, data: bytes) -> int:
        """Append `data` and return its length, even if it can't be written."""
        left = memoryview(data)
        try:
            while left and self.failed is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._fail(error.strerror or str(error))
        self._size += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Return the size of the file. The MCAP writer calls this even with seeking disabled."""
        return self._size

    def flush(self) -> None:
        """Do nothing: the file is unbuffered."""

    def check(self) -> None:
        """Check that the file still holds everything that was written."""
        if self.failed is None and not self._file.closed:
            lost = self._lost()
            if lost:
                self._fail(lost)

    def close(self) -> None:
        """Close the file; may be called again."""
        self.check()
        try:
            self._file.close()
        except OSError as error:
            if self.failed is None:
                self._fail(error.strerror or str(error))

    def _lost(self) -> str | None:
        """Return what another program did to the file, or None."""
        ours = os.fstat(self._file.fileno())
        if not S_ISREG(ours.st_mode):
            return None
        try:
            found = self._path.stat()
        except OSError:
            return f"`{self._path}` was removed or moved"
        if not os.path.samestat(ours, found):
            return f"`{self._path}` was replaced"
        if found.st_size != self._size:
            return f"`{self._path}` has {found.st_size} bytes, but {self._size} were written"
        return None

    def _fail(self, reason: str) -> None:
        self.failed = f"the {self._what} stopped: {reason}"


def whole_lines(path: Path) -> list[str]:
    """Return the complete lines of a growing file; none if there is no file. After a run that was
    killed, the last line may be incomplete and is left out."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return text.split("\n")[:-1]
