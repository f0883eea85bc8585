"""Finds the states and transitions of a mission that no run has taken.

Transitions from one state with equal cause, target and mission line count as one, because the
events of a run don't distinguish them. Implied transitions and built-in states don't count.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from kybflow.core.signals import Event
from kybflow.dsl.plan import Plan

_CAUSES = {"done": "then", "refused": "failed"}
"""The cause of the transition for each `how` of an ended behavior, where the two differ."""


class StateItem(NamedTuple):
    """A state of a vehicle. at: its mission line."""

    vehicle: str
    name: str
    at: str = ""

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.name}"


class TransitionItem(NamedTuple):
    """A transition of a vehicle. at: its mission line."""

    vehicle: str
    source: str
    cause: str
    target: str
    at: str

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.source} -> {self.target} ({self.cause})"


CoverageItem = StateItem | TransitionItem


class CoverageListener:
    """Collects the states and transitions of a run from its events."""

    def __init__(self) -> None:
        self.taken: set[CoverageItem] = set()
        self._left: dict[str, tuple[str, str, str]] = {}

    def on_event(self, event: Event) -> None:
        name, vehicle = str(event.fields.get("behavior")), event.vehicle
        if event.name == "behavior_ended":
            how = str(event.fields["how"])
            self._left[vehicle] = (name, _CAUSES.get(how, how), event.at)
        elif event.name == "behavior_started":
            self.taken.add(StateItem(vehicle, name))
            left = self._left.pop(vehicle, None)
            if left is not None:
                source, cause, at = left
                self.taken.add(TransitionItem(vehicle, source, cause, name, at))


def coverage_items(plan: Plan) -> list[CoverageItem]:
    """Return every state and transition that the mission declares, in order."""
    found: list[CoverageItem] = []
    for vehicle in plan.vehicles:
        for state in vehicle.states.values():
            if state.built_in:
                continue
            found.append(StateItem(vehicle.name, state.name, state.at))
            found += [
                TransitionItem(vehicle.name, state.name, t.cause, t.target, t.at)
                for t in state.transitions
                if not t.implied
            ]
    return list(dict.fromkeys(found))


class Coverage(NamedTuple):
    """The states and transitions of a mission that its runs `missed`, out of a `total`."""

    total: int
    missed: tuple[CoverageItem, ...]

    @property
    def share(self) -> float:
        return 1.0 - len(self.missed) / self.total if self.total else 1.0


def covered(items: Iterable[CoverageItem], taken: Iterable[CoverageItem]) -> Coverage:
    """Return how much of `items` is `taken`. States in `taken` have no mission line."""
    everything, known = tuple(items), set(taken)
    missed = tuple(
        one
        for one in everything
        if (one._replace(at="") if isinstance(one, StateItem) else one) not in known
    )
    return Coverage(len(everything), missed)
