"""The root of every part."""

from __future__ import annotations

from abc import ABC
from typing import ClassVar, Generic, NamedTuple, TypeVar

P = TypeVar("P")


class Objection(NamedTuple):
    """Why a part can't work as it is told, the parameter that says it, and the way out."""

    parameter: str
    reason: str
    hint: str = ""


class Part(ABC, Generic[P]):
    """The root of every part. `kind` is the plural that names its folder and its group in the
    catalog. `events` are the events that its alarms become, or that an action emits. `reserved`
    are the names of a kind that no part may have, because the language has them. `helpers` are
    modules that stand beside the parts of a kind and are none. `packages` are
    those that kybflow does without and it does not, any one of those between which there is a
    choice; the record of a run tells their versions."""

    kind: ClassVar[str]
    events: ClassVar[tuple[str, ...]] = ()
    reserved: ClassVar[frozenset[str]] = frozenset()
    helpers: ClassVar[frozenset[str]] = frozenset()
    packages: ClassVar[tuple[str, ...]] = ()
    params: P
