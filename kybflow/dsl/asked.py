"""Which states somebody else than their own vehicle's arrows may ask for: callbacks and flows."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from kybflow.dsl.document import Document
from kybflow.dsl.option_names import members


def with_asked(document: Document) -> Document:
    """The document, whose vehicles know which of their states callbacks and flows ask for."""
    asked = set(_asked(document))
    if not asked:
        return document
    vehicles = {
        name: dataclasses.replace(
            vehicle, asked=frozenset(state for who, state in asked if who == name)
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
        for vehicle in members(document, who):
            if vehicle in document.vehicles:
                goal = document.vehicles[vehicle].goal(state)
                if goal in document.vehicles[vehicle].states:
                    yield vehicle, goal
