"""Events. Each is a small class, and constructing one describes one occurrence.

    class ClampStarted(VehicleEvent):
        '''A processor keeps the setpoint from where the behavior wants it.'''

        processor: str
        reason: str

    events.emit(ClampStarted(processor="fence", reason="too high"), "nano")

Missions and recordings use the class's name in snake case, `clamp_started`. A class whose name is
already used elsewhere ends in `Event`, which the event's name omits. The docstring of the class is
the event's help. The fields are recorded in the order of their declaration; a field that has its
default value is not recorded. A quantity has a type of `kybflow.core.units`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self, dataclass_transform

from kybflow.core.signals import Alarm, Done, FieldValue, Setpoint, kind_name

Needs = Literal["a camera", "motion capture", "a payload", "flows", "other commanders"]
"""What a vehicle must have to emit an event. flows: the mission has flows. other commanders: other
programs or people can command the vehicle."""
Awaited = Literal["anywhere", "to log it", "too late", "nowhere"]
"""Where a mission can wait for an event. to log it: only a simulator knows of the event, so a
callback may log it and do nothing else. too late: no tick follows the event. nowhere: the event is
only recorded."""

_NEEDED: Any = object()
"""Marks a field without a default."""


class _Interpreted(type):
    """Makes mypyc leave an event class uncompiled; a compiled class would lose its field
    declarations."""


@dataclass_transform(kw_only_default=True, frozen_default=True)
class BaseEvent(metaclass=_Interpreted):
    """The base of `RunEvent` and `VehicleEvent`.

    name: the event's name in missions and recordings. fields: the default of each field, in order.
    needs: what a vehicle must have to emit the event. awaited: where a mission can wait for it.
    """

    name: str = ""
    fields: ClassVar[Mapping[str, Any]] = {}
    needs: ClassVar[Needs | None] = None
    awaited: ClassVar[Awaited] = "anywhere"

    def __init_subclass__(cls) -> None:
        own = {field: vars(cls).get(field, _NEEDED) for field in cls.__annotations__}
        if taken := [field for field in own if hasattr(BaseEvent, field)]:
            raise TypeError(f"a field of {cls.__name__} can't be called `{taken[0]}`")
        cls.fields = {**cls.fields, **own}
        cls.name = kind_name(cls).removesuffix("_event")

    def __init__(self, **given: FieldValue) -> None:
        values = {**self.fields, **given}
        if len(values) > len(self.fields) or _NEEDED in values.values():
            raise TypeError(f"`{self.name}` has the fields {[*self.fields]}, not {[*given]}")
        vars(self).update(values)

    def recorded(self) -> dict[str, FieldValue]:
        """Return the fields that are recorded: those that differ from their defaults."""
        own = vars(self)
        return {name: own[name] for name, default in self.fields.items() if own[name] != default}

    def replaced(self, **values: FieldValue) -> Self:
        """Return a copy of the event with other values of some fields."""
        return type(self)(**{**vars(self), **values})

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={value!r}" for name, value in vars(self).items())
        return f"{type(self).__name__}({fields})"


class RunEvent(BaseEvent):
    """An event of the whole run, which belongs to no vehicle."""


class VehicleEvent(BaseEvent):
    """An event of a vehicle."""


class BehaviorEvent(VehicleEvent):
    """An event that only one behavior emits; it is listed in the behavior's `own_events`. behavior:
    the vehicle's state, filled in by the runtime."""

    behavior: str = ""


class ProcessorEvent(VehicleEvent):
    """An event that only one processor emits; it is listed in the processor's `own_events`.
    processor: the processor's name, filled in by the runtime."""

    processor: str = ""


class Custom(RunEvent):
    """An event without fields that a mission defines, an operator emits, or a flow emits when it
    ends."""

    def __init__(self, name: str) -> None:
        self.name = name


class AlarmRaised(VehicleEvent):
    """An alarm of a supervisor or a processor. The alarm determines the event's name."""

    reaction: str
    reason: str
    value: float | None = None
    bound: float | None = None

    def __init__(self, alarm: Alarm) -> None:
        reaction = alarm.reaction.name.lower()
        super().__init__(
            reaction=reaction, reason=alarm.reason, value=alarm.value, bound=alarm.bound
        )
        self.name = alarm.event


class Emitting(NamedTuple):
    """A behavior's or a processor's output together with an event. output: the update of the
    behavior, or the setpoint of the processor. event: one of the `own_events` of the class."""

    output: Setpoint | Done
    event: BehaviorEvent | ProcessorEvent
