"""What several checks ask of flows: which phases are reached, who asks what of whom."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.dsl.document import Document, Flow, Phase, Vehicle
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.names.option_names import members
from kybflow.dsl.plan import END
from kybflow.dsl.reading.source import Text


class Wish(NamedTuple):
    """What a phase asks of one vehicle: to enter a state, or to be given to a flow. `who` is the
    vehicle or the group as written."""

    vehicle: str
    who: Text
    goal: Text


def phases(document: Document) -> Iterator[tuple[Flow, Phase]]:
    """Every phase of every flow."""
    for flow in document.flows.values():
        for phase in flow.phases.values():
            yield flow, phase


def wishes(document: Document, pairs: tuple[tuple[Text, Text], ...]) -> Iterator[Wish]:
    """The `run` or the `give` of a phase, vehicle by vehicle; unknown names are left out."""
    for who, goal in pairs:
        for vehicle in members(document, who.text):
            if vehicle in document.vehicles:
                yield Wish(vehicle, who, goal)


def gifts(document: Document, phase: Phase) -> Iterator[Wish]:
    """The `give` of a phase, vehicle by vehicle, to flows that exist."""
    yield from (w for w in wishes(document, phase.give) if w.goal.text in document.flows)


def all_known(document: Document) -> bool:
    """Whether every vehicle and state that phases ask for exists."""
    asked = [(who.text, state.text) for _, phase in phases(document) for who, state in phase.run]
    return all(
        bool(members(document, who))
        and all(
            has_state(document.vehicles[v], state) or state in BUILT_IN
            for v in members(document, who)
        )
        for who, state in asked
    )


def has_state(vehicle: Vehicle, state: str) -> bool:
    """Whether a mission's own state, or a chain of them, has that name."""
    return vehicle.goal(state) in vehicle.states


def reached(document: Document, flow: Flow) -> set[str]:
    """The phases that arrows lead to from the first, or from one that a callback asks for."""
    waiting = [flow.begin.text, *_asked(document, flow)]
    found = set(waiting)
    while waiting:
        phase = flow.phases.get(waiting.pop())
        for arrow in phase.transitions if phase else ():
            if arrow.target.text not in found:
                found.add(arrow.target.text)
                waiting.append(arrow.target.text)
    return found - {END}


def _asked(document: Document, flow: Flow) -> Iterator[str]:
    """The phases of the flow that callbacks enter."""
    for callback in document.callbacks:
        for action in callback.actions:
            named = action.target is None or action.target.text == flow.name.text
            if action.name.text == "phase" and named and action.value.text in flow.phases:
                yield action.value.text
