"""Which states somebody else than their own vehicle's arrows may ask for: callbacks and flows."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from kybflow.dsl.document import Document, Flow
from kybflow.dsl.names.option_names import members
from kybflow.dsl.shaping.flows import GROUNDED, own_vehicles


def with_asked(document: Document) -> Document:
    """The document, whose vehicles know which of their states callbacks and flows ask for."""
    asked = set(_asked(document))
    if not asked:
        return document
    first = set(_asked_first(document))
    vehicles = {
        name: dataclasses.replace(
            vehicle,
            asked=frozenset(state for who, state in asked if who == name),
            asked_first=frozenset(state for who, state in first if who == name),
        )
        for name, vehicle in document.vehicles.items()
    }
    return dataclasses.replace(document, vehicles=vehicles)


def _asked(document: Document) -> Iterator[tuple[str, str]]:
    """(vehicle, state) of each wish; names that are unknown are left out."""
    wishes = [
        (action.target.text, action.value.text)
        for callback in document.callbacks
        for action in callback.actions
        if action.name.text == "switch" and action.target is not None
    ]
    wishes += [
        (who.text, state.text)
        for flow in document.flows.values()
        for phase in flow.phases.values()
        for who, state in phase.run
    ]
    for who, state in wishes:
        yield from _goals(document, who, state)


def _goals(document: Document, who: str, state: str) -> Iterator[tuple[str, str]]:
    for vehicle in members(document, who):
        goal = document.vehicles[vehicle].goal(state)
        if goal in document.vehicles[vehicle].states:
            yield vehicle, goal


def _asked_first(document: Document) -> Iterator[tuple[str, str]]:
    """(vehicle, state) of the first wishes that a flow has for a vehicle which waits for it."""
    for flow in document.flows.values():
        for vehicle in own_vehicles(document, flow):
            if document.vehicles[vehicle].begin.text == GROUNDED:
                yield from _first_of(document, flow, vehicle)


def _first_of(document: Document, flow: Flow, vehicle: str) -> Iterator[tuple[str, str]]:
    """Along the arrows from the first phase, until a phase asks something or gives it away."""
    waiting, seen = [flow.begin.text], {flow.begin.text}
    while waiting:
        phase = flow.phases.get(waiting.pop())
        if phase is None:
            continue
        wishes = [w for who, state in phase.run for w in _goals(document, who.text, state.text)]
        yield from (wish for wish in wishes if wish[0] == vehicle)
        asked = (*phase.run, *phase.give)
        if any(vehicle in members(document, who.text) for who, _ in asked):
            continue
        fresh = {arrow.target.text for arrow in phase.transitions} - seen
        seen |= fresh
        waiting += fresh
