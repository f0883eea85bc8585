"""Types of parameters that name a file."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class File:
    """A file as it was when the mission was compiled. It is never opened again, so the mission
    flies with the contents that were checked.

    name: the path as written, relative to the YAML file that names it. sha256: the digest of its
    bytes. text: its contents (UTF-8).
    """

    name: str
    sha256: str
    text: str = field(repr=False, compare=False)

    def __str__(self) -> str:
        return self.name


class FilePath(str):
    """The absolute path of a file that is too large to read at compile time. It is written relative
    to the YAML file that names it; the compiler checks that it exists."""

    __slots__ = ()
