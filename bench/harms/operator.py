"""What a change is: an operator makes the changes of one kind that a mission has places for.

dangerous: the vehicle could crash, leave its fence, fall, fly away, or hang in the air until the
failsafe acts. senseless: the mission can't do what it says, or what it says says nothing. valid:
another sensible mission, of which nothing may be said.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

from harms.mission_text import Edit, Mission, Node

Label = Literal["dangerous", "senseless", "valid"]
Half = Literal["development", "held-out"]


class Change(NamedTuple):
    """One change of a mission. also: nodes whose line is right too, because what was changed
    contradicts them. target: for which the mission is compiled."""

    edits: tuple[Edit, ...]
    also: tuple[Node, ...] = ()
    target: str | None = None


Changes = Iterator[Change]


class Operator(NamedTuple):
    """name: that of the function; make: the changes that it has for a mission."""

    name: str
    label: Label
    make: Callable[[Mission], Changes]

    @property
    def half(self) -> Half:
        """By a hash of the name, so that it never depends on the other operators."""
        return "held-out" if hashlib.sha256(self.name.encode()).digest()[0] % 2 else "development"

    @property
    def why(self) -> str:
        return (self.make.__doc__ or "").strip()


def change(*edits: Edit, also: tuple[Node | None, ...] = (), target: str | None = None) -> Change:
    return Change(edits, tuple(node for node in also if node is not None), target)


def dangerous(make: Callable[[Mission], Changes]) -> Operator:
    return Operator(make.__name__, "dangerous", make)


def senseless(make: Callable[[Mission], Changes]) -> Operator:
    return Operator(make.__name__, "senseless", make)


def valid(make: Callable[[Mission], Changes]) -> Operator:
    return Operator(make.__name__, "valid", make)
