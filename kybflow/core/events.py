"""What an event is: a small class. Emitting one is constructing it.

    class ClampStarted(VehicleEvent):
        '''A processor keeps the setpoint from where the behavior wants it.'''

        processor: str
        reason: str

    events.emit(ClampStarted(processor="fence", reason="too high"), "nano")

Missions and recordings call it by the class's name, `clamp_started`; a class that would share its
name with another one ends in `Event`, which is left out. The docstring is its help. Its fields are
recorded in the order of their declaration, and one that has its default is left out. A quantity has
a type of `kybflow.core.units`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self, dataclass_transform

from kybflow.core.signals import Alarm, Done, FieldValue, Setpoint, kind_name

Needs = Literal["a camera", "motion capture", "a payload", "flows", "other commanders"]
"""What a vehicle must have to emit an event. flows: the mission has some. other commanders: other
programs or people can command the vehicle."""
Awaited = Literal["anywhere", "to log it", "too late", "nowhere"]
"""Where a mission can wait for an event. to log it: only a simulator knows it, so a callback may
log it and nothing else. too late: no tick follows it. nowhere: it is recorded only."""

_NEEDED: Any = object()
"""The default of a field that has none."""


class _Interpreted(type):
    """Makes mypyc leave an event an ordinary class: a compiled one would lose its declaration."""


@dataclass_transform(kw_only_default=True, frozen_default=True)
class BaseEvent(metaclass=_Interpreted):
    """The base of `RunEvent` and `VehicleEvent`. name: what missions and recordings call it.
    fields: the default of each field, in order."""

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
        """Return the fields that are recorded."""
        own = vars(self)
        return {name: own[name] for name, default in self.fields.items() if own[name] != default}

    def replaced(self, **values: FieldValue) -> Self:
        """Return the event with other values of some fields."""
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
    """An event of a behavior's own, which is among its `own_events`. behavior: the vehicle's state,
    which the runtime fills in."""

    behavior: str = ""


class ProcessorEvent(VehicleEvent):
    """An event of a processor's own, which is among its `own_events`. processor: its name, which
    the runtime fills in."""

    processor: str = ""


class Custom(RunEvent):
    """An event of a mission's own, of a person, or at the end of a flow. It carries nothing."""

    def __init__(self, name: str) -> None:
        self.name = name


class AlarmRaised(VehicleEvent):
    """An alarm of a supervisor or a processor, which gives the event its name."""

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
    """A behavior's update, or a processor's setpoint, that also emits an event, one of its class's
    `own_events`. output: the update itself."""

    output: Setpoint | Done
    event: BehaviorEvent | ProcessorEvent
