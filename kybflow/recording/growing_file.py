"""A file that grows while a run flies."""

from __future__ import annotations

import os
from io import FileIO
from pathlib import Path
from stat import S_ISREG


class GrowingFile:
    """A file that is appended to while a run flies, unbuffered, so that what is written survives
    this program.

    An error is kept in `failed` and ends the file: what comes later is dropped. So is the loss of
    what was written, when somebody removes, replaces or shortens the file. what: the name of its
    contents in `failed`. Raises OSError when the file can't be opened.
    """

    def __init__(self, path: Path, what: str) -> None:
        self._path, self._what = path, what
        # appending: a file that somebody shortened would else be filled up with zeros
        self._file = FileIO(path, "w", opener=_appending)
        self._size = 0
        self.failed: str | None = None

    def write(self, data: bytes) -> int:
        """Append `data`; its length, whether or not it could be written."""
        left = memoryview(data)
        try:
            while left and self.failed is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._fail(error.strerror or str(error))
        self._size += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Where the file ends; with seeking disabled the MCAP writer only asks for that."""
        return self._size

    def flush(self) -> None:
        """There is nothing to flush: the file is unbuffered."""

    def look(self) -> None:
        """Look whether what was written is still in its place."""
        if self.failed is None and not self._file.closed:
            lost = self._lost()
            if lost:
                self._fail(lost)

    def close(self) -> None:
        """Close the file; may be called again."""
        self.look()
        try:
            self._file.close()
        except OSError as error:
            if self.failed is None:
                self._fail(error.strerror or str(error))

    def _lost(self) -> str | None:
        """What somebody else did to the file, None where nothing was done."""
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


def _appending(name: str, flags: int) -> int:
    return os.open(name, flags | os.O_APPEND, 0o666)


def whole_lines(path: Path) -> list[str]:
    """Return the lines of a file that was written as the run went: the last one of a run that was
    killed may be a part only, and is left out. None where there is no file."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return text.split("\n")[:-1]
