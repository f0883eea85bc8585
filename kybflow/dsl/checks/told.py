"""Which events a mission can hear: the engine's, those of its vehicles' parts, those that its
callbacks emit, and what a person asks for."""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.dsl.checks.case import Case
from kybflow.dsl.document import Document, Vehicle
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.names.option_names import members
from kybflow.parts.observables import ALARM_FIELDS, EVENT_FIELDS, EVENTS, OF_THE_RUN

ANY = "any"
OPERATOR = "operator."
"""How the name of an event begins that a person gives."""


class Told:
    """The events of a mission. `custom` are those that its actions emit and the ends of its flows,
    `of` those of a vehicle by their bare names."""

    def __init__(self, case: Case) -> None:
        self._document = case.document
        self.custom = emitted(case.document) | {f"{n}.finished" for n in case.document.flows}
        self.of = {v.name.text: _told_by(v, case) for v in case.vehicles()}

    @property
    def of_the_run(self) -> frozenset[str]:
        return OF_THE_RUN | self.custom | {f"{flow}.finished" for flow in self._document.flows}

    def tellers(self, event: str) -> tuple[str, ...]:
        """The vehicles that an event's name speaks of: `("",)` is the run. None tells an unknown
        one."""
        first, dot, name = event.partition(".")
        if event in self.of_the_run or event.startswith(OPERATOR):
            return ("",)
        if not dot:
            return ()
        asked = tuple(self.of) if first == ANY else members(self._document, first)
        return tuple(vehicle for vehicle in asked if name in self.of[vehicle])

    def hears(self, event: str, own: str | None) -> bool:
        """Whether an arrow can hear an event: of the vehicle `own`, or of a flow (None)."""
        if own is not None and event in self.of[own]:
            return True
        return event.partition(".")[0] not in self._document.groups and bool(self.tellers(event))

    def names(self, own: str | None, groups: Iterable[str]) -> set[str]:
        """Every name under which an event can be heard: by `own` also its vehicle's bare ones, and
        those of `groups`."""
        events = {event for told in self.of.values() for event in told}
        return {
            *self.of_the_run,
            *(f"{vehicle}.{event}" for vehicle, told in self.of.items() for event in told),
            *(f"{first}.{event}" for first in (ANY, *groups) for event in events),
            *self.of.get(own or "", ()),
        }


def emitted(document: Document) -> frozenset[str]:
    """The custom events that the actions of a mission emit."""
    found: set[str] = set()
    for callback in document.callbacks:
        for action in callback.actions:
            if action.name.text == "emit":
                found.add(action.value.text)
            elif action.part is not None:
                found.update(action.part.spec.cls.events)
    return frozenset(found)


def fields_of(event: str) -> tuple[str, ...]:
    """What an event carries, by its bare name; a custom one nothing."""
    return EVENT_FIELDS.get(event, ALARM_FIELDS)


def _told_by(vehicle: Vehicle, case: Case) -> frozenset[str]:
    """The events that belong to the vehicle, by their bare names."""
    parts = [*vehicle.processors, *vehicle.supervisors, vehicle.tracker, vehicle.driver]
    parts += [estimator.part for estimator in vehicle.estimators]
    parts += [state.part for state in vehicle.states.values()]
    classes = [part.spec.cls for part in parts]
    classes += [case.catalog.get("behaviors", name).cls for name in BUILT_IN.values()]
    declared = {event for cls in classes for event in cls.events}
    return frozenset((EVENTS.keys() - OF_THE_RUN) | declared)
