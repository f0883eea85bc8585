"""The types of parameters that name a file, the name of a run's control file, and atomic
writing."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

CONTROL = "control.json"
"""The file in a run's folder that holds the address at which the flying run accepts commands."""


@dataclass(frozen=True, slots=True)
class File:
    """A file as it was when the mission was compiled. It is never opened again, so the mission
    flies with the contents that were checked.

    name: the path as written, relative to the YAML file that names it. sha256: the digest of its
    bytes. text: its contents, decoded as UTF-8; bytes that are not UTF-8 become surrogate escapes
    where the parameter allows binary files.
    """

    name: str
    sha256: str
    text: str = field(repr=False, compare=False)

    def __str__(self) -> str:
        return self.name

    @property
    def is_text(self) -> bool:
        """Whether the whole file is valid UTF-8."""
        try:
            self.text.encode()
        except UnicodeEncodeError:
            return False
        return True

    @property
    def data(self) -> bytes:
        """The bytes of the file, without a byte order mark."""
        return self.text.encode("utf-8", "surrogateescape")


class FilePath(str):
    """The absolute path of a file that is too large to read at compile time. In the mission, the
    path is relative to the YAML file that names it; the compiler checks that the file exists."""

    __slots__ = ()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file completely or not at all: if writing fails or is interrupted, the file is
    removed. A file that can't be opened stays unchanged. Raises OSError."""
    stream = path.open("wb")
    try:
        with stream:
            stream.write(data)
    except BaseException:
        with suppress(OSError):
            if path.is_symlink() or path.is_file():  # devices, such as /dev/full, are kept
                path.unlink()
        raise
