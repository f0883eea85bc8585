"""The base class of every part."""

from __future__ import annotations

from abc import ABC
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from kybflow.core.events import BehaviorEvent, ProcessorEvent

P = TypeVar("P")


class Objection(NamedTuple):
    """Why a part can't work as configured: the parameter, the reason, and a hint on what to write
    instead. is_doubt: the part can work, but probably not as intended."""

    parameter: str
    reason: str
    hint: str = ""
    is_doubt: bool = False

    @classmethod
    def of(cls, parameter: str, error: Exception) -> Objection:
        """Return the objection for an error whose message ends with `: write ...`, its hint."""
        reason, colon, rest = str(error).partition(": write ")
        return cls(parameter, reason, f"write {rest}" if colon else "")


class Claim(NamedTuple):
    """Something that a part needs for its vehicle alone. parameter: the parameter that names it.
    what: a description of it."""

    parameter: str
    what: str


class Part(ABC, Generic[P]):
    """The base class of every part.

    kind: the plural name of the kind of part, which is also its folder and its group in the
    catalog. own_events: events that a behavior or a processor emits beside its output. events: the
    names of the events that the part's alarms become or that an action emits; those of `own_events`
    are added. reserved: names that no part of this kind may have, because the language uses them.
    helpers: modules in the kind's folder that are not parts. packages: optional dependencies of the
    part (if they are alternatives, any one is enough); the record of a run contains their versions.
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
