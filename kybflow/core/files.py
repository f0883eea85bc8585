"""Types of parameters that name a file, the file by which a run is found, and how a whole file is
written."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

CONTROL = "control.json"
"""The file in a run's folder with the address at which a flying run takes commands."""


@dataclass(frozen=True, slots=True)
class File:
    """A file as it was when the mission was compiled. It is never opened again, so the mission
    flies with the contents that were checked.

    name: the path as written, relative to the YAML file that names it. sha256: the digest of its
    bytes. text: its contents, UTF-8; other bytes, where the parameter allows them, are surrogates.
    """

    name: str
    sha256: str
    text: str = field(repr=False, compare=False)

    def __str__(self) -> str:
        return self.name

    @property
    def is_text(self) -> bool:
        """Whether all of it is text."""
        try:
            self.text.encode()
        except UnicodeEncodeError:
            return False
        return True

    @property
    def data(self) -> bytes:
        """Its bytes, but for a byte order mark."""
        return self.text.encode("utf-8", "surrogateescape")


class FilePath(str):
    """The absolute path of a file that is too large to read at compile time. It is written relative
    to the YAML file that names it; the compiler checks that it exists."""

    __slots__ = ()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file completely or not at all: a full disk or an interruption leaves no file. A file
    that can't be opened stays as it is. Raises OSError."""
    stream = path.open("wb")
    try:
        with stream:
            stream.write(data)
    except BaseException:
        with suppress(OSError):
            if path.is_symlink() or path.is_file():  # a device, such as /dev/full, stays
                path.unlink()
        raise
