"""A file that a parameter names: read once, when the mission is compiled, or only found then."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class File:
    """The type of a parameter that names a file: what it held when the mission was compiled.
    Nothing opens it again, so that what flies is what was checked.

    name: as the mission writes it, relative to the file that it is written in. sha256: of its
    bytes. text: what it holds (UTF-8).
    """

    name: str
    sha256: str
    text: str = field(repr=False, compare=False)

    def __str__(self) -> str:
        return self.name


class FilePath(str):
    """The type of a parameter that names a file which is too large to be read before it is needed:
    its absolute path. The mission writes it as seen from the file that it is written in; that it
    is there is checked when the mission is compiled."""

    __slots__ = ()
