"""The base class of every part."""

from __future__ import annotations

from abc import ABC
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from kybflow.core.events import BehaviorEvent, ProcessorEvent

P = TypeVar("P")


class Objection(NamedTuple):
    """Why a part can't work as configured: the parameter, the reason, and what to write. is_doubt:
    it can, but hardly as it was meant."""

    parameter: str
    reason: str
    hint: str = ""
    is_doubt: bool = False


class Claim(NamedTuple):
    """What a part takes for its vehicle alone: the parameter that says it, and what it is, in
    words."""

    parameter: str
    what: str


class Part(ABC, Generic[P]):
    """The base class of every part.

    kind: the plural that names the kind's folder and its group in the catalog. own_events: what a
    behavior or a processor emits beside its output. events: the names of what the part's alarms
    become, or an action emits; those of `own_events` are added. reserved: names that no part of the
    kind may have, because the language uses them. helpers: modules in the kind's folder that are no
    parts. packages: optional dependencies that the part needs, of alternatives any one; the record
    of a run has their versions.
    """

    kind: ClassVar[str]
    own_events: ClassVar[tuple[type[BehaviorEvent | ProcessorEvent], ...]] = ()
    events: ClassVar[tuple[str, ...]] = ()
    reserved: ClassVar[frozenset[str]] = frozenset()
    helpers: ClassVar[frozenset[str]] = frozenset()
    packages: ClassVar[tuple[str, ...]] = ()
    params: P

    def __init_subclass__(cls, **rest: Any) -> None:
        super().__init_subclass__(**rest)
        own = (event.name for event in cls.own_events)
        cls.events = tuple(dict.fromkeys((*cls.events, *own)))
