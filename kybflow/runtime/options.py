"""Options: reads and changes the parameters of parts during a run.

`mk.processors.limit_speed.speed` is the parameter `speed` of the processor `limit_speed` of `mk`.
Type, unit and bounds are those of the parameter's declaration. A change takes effect at the next
tick, and its event names the requester. A refused change has no effect, and its event gives the
reason. A safety parameter can only be tightened while its vehicle flies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

from kybflow.core.errors import OptionRefused
from kybflow.core.params import Field, fields_of, type_of
from kybflow.core.text import nearest
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.language.records import NO_PLACE
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.dsl.reading.nodes import Node, Scalar, Sequence
from kybflow.dsl.reading.reader import compose
from kybflow.dsl.reading.values import decode_value
from kybflow.parts.events import OptionChanged, OptionRefusedEvent
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.requests import Answered, unheard


class Holder(Protocol):
    """An object that has options, such as a vehicle: it holds the parameters of its parts."""

    name: str

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground and its rotors turn."""

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of each part, by the part's label (`processors.limit_speed`)."""

    def change(self, label: str, name: str, value: Any) -> None:
        """Replace the value of the parameter `name` of the part `label`."""


Objection = Callable[[str, str, Field, Any], str | None]
"""Returns why a part can't have a value, or None: given the vehicle, the part's label, the
parameter and the value (SI)."""


class _Change(NamedTuple):
    """A requested change that waits for the next tick."""

    holder: Holder
    label: str
    field: str
    value: Any
    by: str
    at: str
    answered: Answered


class Options:
    """The options of every vehicle. Changes wait for the next tick.

    holders: the vehicles by name; more may be added to the mapping until the first call.
    objection: judges each value as a compiler judges what a mission declares.
    """

    def __init__(
        self, holders: Mapping[str, Holder], events: Events, objection: Objection | None = None
    ) -> None:
        self._holders = holders
        self._events = events
        self._objection = objection
        self._waiting: list[_Change] = []

    def names(self) -> Iterator[str]:
        for name, holder in self._holders.items():
            for label, parameters in holder.parameters().items():
                for field in fields_of(parameters.__class__):
                    yield f"{name}.{label}.{field.name}"

    def get(self, name: str) -> Any:
        """Return the current value (SI). Raises OptionRefused for an unknown name."""
        holder, label, field = self._find(name)
        return getattr(holder.parameters()[label], field.name)

    def set(
        self, name: str, value: Any, by: str, at: str = "", answered: Answered = unheard
    ) -> None:
        """Request a change. Raises OptionRefused with the reason if it is refused at once.

        value: a value in SI units, or text with a unit.
        by: the requester. at: its mission line.
        answered: called when the change has been applied or refused in the next tick.
        """
        try:
            holder, label, field = self._find(name)
            if field.read_only:
                raise OptionRefused(f"`{name}` is read-only")
            value = _decoded(name, value, field)
            for named in field.named(value, "vehicle"):
                if named not in self._holders:
                    raise OptionRefused(f"there is no vehicle `{named}`")
            reason = self._loosened(holder, label, field.name, value)
            if reason is None and self._objection is not None:
                reason = self._objection(holder.name, label, field, value)
            if reason is not None:
                raise OptionRefused(reason)
        except OptionRefused as refusal:
            vehicle = name.partition(".")[0]
            whose = vehicle if vehicle in self._holders else ""
            refused = OptionRefusedEvent(option=name, by=by, reason=str(refusal))
            self._events.emit(refused, whose, at)
            raise
        self._waiting.append(_Change(holder, label, field.name, value, by, at, answered))

    def apply(self) -> None:
        """Apply the requested changes. The engine calls it at the start of a tick."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        for holder, label, field, value, by, at, answered in waiting:
            name = f"{holder.name}.{label}.{field}"
            reason = self._loosened(holder, label, field, value)
            if reason is None:
                holder.change(label, field, value)
                changed = OptionChanged(option=name, value=str(value), by=by)
                self._events.emit(changed, holder.name, at)
            else:  # the vehicle has taken off, or another change came first
                refused = OptionRefusedEvent(option=name, by=by, reason=reason)
                self._events.emit(refused, holder.name, at)
            answered(reason)

    def _loosened(self, holder: Holder, label: str, field_name: str, value: Any) -> str | None:
        """Return why a parameter can't be set to `value` while the vehicle flies, or None."""
        if not holder.airborne:
            return None
        parameters = holder.parameters()[label]
        [field] = (f for f in fields_of(parameters.__class__) if f.name == field_name)
        name = f"{holder.name}.{label}.{field_name}"
        return loosened(name, field, getattr(parameters, field_name), value)

    def _find(self, name: str) -> tuple[Holder, str, Field]:
        vehicle, _, rest = name.partition(".")
        label, _, field_name = rest.rpartition(".")
        holder = self._holders.get(vehicle)
        parameters = holder.parameters().get(label) if holder else None
        if holder is None or parameters is None:
            raise self._unknown(name)
        for field in fields_of(parameters.__class__):
            if field.name == field_name:
                return holder, label, field
        raise self._unknown(name)

    def _unknown(self, name: str) -> OptionRefused:
        near = nearest(name, self.names())
        hint = f"; did you mean `{near}`?" if near else ""
        return OptionRefused(f"there is no option `{name}`{hint}")


class _Planned:
    """The options of a planned vehicle, which is not constructed yet."""

    def __init__(self, plan: VehiclePlan) -> None:
        self.name = plan.name
        self._parameters = {part.label: part.params for part in plan.parts}

    @property
    def airborne(self) -> bool:
        return False

    def parameters(self) -> dict[str, Any]:
        return self._parameters

    def change(self, label: str, name: str, value: Any) -> None:
        self._parameters[label] = replace(self._parameters[label], **{name: value})


def check_options(
    plan: Plan, wanted: Iterable[tuple[str, str]], objection: Objection | None = None
) -> None:
    """Raise OptionRefused for the first (name, value) in `wanted` that can't be set. Needs only the
    plan, so that this can be checked before any link or file is opened."""
    planned = {vehicle.name: _Planned(vehicle) for vehicle in plan.vehicles}
    options = Options(planned, Events(), objection)
    for name, value in wanted:
        options.set(name, value, "command line")


def _decoded(name: str, value: Any, field: Field) -> Any:
    """Return `value` converted to the field's type and checked as if a mission gave it. Raises
    OptionRefused."""
    if field.type.fixed:
        raise OptionRefused(f"`{name}` is a {type_of(field)} and can't be changed in flight")
    found = Collector()
    node = _node(value, field, found)
    decoded = None if node is None else decode_value(node, replace(field, key=name), found)
    for finding in found.all:
        reason = finding.message if name in finding.message else f"`{name}`: {finding.message}"
        reason = f"{reason}, not {finding.label}" if finding.label else reason
        raise OptionRefused(f"{reason}; {finding.help}" if finding.help else reason)
    return decoded


def _node(value: Any, field: Field, found: Collector) -> Node | None:
    """Return the YAML node with which a mission would give this value (SI, or text). The text of a
    list may lack its brackets."""
    if isinstance(value, str):
        text, is_list = value.strip(), field.shape in ("vector", "matrix", "names")
        if not is_list or not text:
            return Scalar(value, NO_PLACE, quoted=field.shape == "text")
        return compose(text if text[0] + text[-1] == "[]" else f"[{text}]", "", found)
    if isinstance(value, Iterable):
        items: list[Node | None] = [
            Scalar(item, NO_PLACE) if isinstance(item, str) else _node(item, field, found)
            for item in value
        ]
        return Sequence(tuple(item for item in items if item is not None), NO_PLACE)
    if field.dimension is not None and isinstance(value, int | float):
        return Scalar(f"{float(value)!r} {field.dimension.si}".rstrip(), NO_PLACE)
    return Scalar(str(value), NO_PLACE)


def loosened(name: str, field: Field, before: Any, after: Any) -> str | None:
    """Return why a parameter can't change from `before` to `after` in flight, or None if it can.

    A safety parameter can only be tightened: a number, or every number of a vector, in its declared
    direction, and a choice towards the stricter end of its list. No choice can become `cut`, which
    would drop the vehicle.
    """
    if field.tightens is None or before == after:
        return None
    if after == "cut":
        return f"`{name}` can't become `cut` in flight"
    has_both = len(field.numbers(before)) == len(field.numbers(after))
    if has_both and not field.loosens(before, after):
        return None
    word = "stricter" if field.choices else "greater" if field.tightens == "up" else "smaller"
    return f"`{name}` is a safety parameter: in flight it only becomes {word}"
