"""Which states and transitions of a mission no run has taken.

Arrows from one state with the same cause, goal and mission line count as one: the events of a run
can't tell them apart. What the language adds by itself, implied arrows and built-in states, is not
asked for.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from kybflow.core.signals import Event
from kybflow.dsl.plan import Plan

_CAUSES = {"done": "then", "refused": "failed"}
"""How a behavior's end is told, where the arrow's cause has another name."""


class State(NamedTuple):
    """A state of a vehicle; `at` is its mission line."""

    vehicle: str
    name: str
    at: str = ""

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.name}"


class Arrow(NamedTuple):
    """A transition of a vehicle; `at` is its mission line."""

    vehicle: str
    source: str
    cause: str
    target: str
    at: str

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.source} -> {self.target} ({self.cause})"


class Traces:
    """A listener that keeps what the vehicles of one run went through."""

    def __init__(self) -> None:
        self.taken: set[State | Arrow] = set()
        self._left: dict[str, tuple[str, str, str]] = {}

    def hear(self, event: Event) -> None:
        name, vehicle = str(event.fields.get("behavior")), event.vehicle
        if event.name == "behavior_ended":
            how = str(event.fields["how"])
            self._left[vehicle] = (name, _CAUSES.get(how, how), event.at)
        elif event.name == "behavior_started":
            self.taken.add(State(vehicle, name))
            left = self._left.pop(vehicle, None)
            if left is not None:
                source, cause, at = left
                self.taken.add(Arrow(vehicle, source, cause, name, at))


def written(plan: Plan) -> list[State | Arrow]:
    """Every state and transition that the mission itself has, in its order."""
    found: list[State | Arrow] = []
    for vehicle in plan.vehicles:
        for state in vehicle.states.values():
            if state.built_in:
                continue
            found.append(State(vehicle.name, state.name, state.at))
            arrows = (arrow for arrow in state.transitions if not arrow.implied)
            found += [Arrow(vehicle.name, state.name, a.cause, a.target, a.at) for a in arrows]
    return list(dict.fromkeys(found))


class Coverage(NamedTuple):
    """How much of a mission its runs took: `missed` of `total` states and transitions."""

    total: int
    missed: tuple[State | Arrow, ...]

    @property
    def share(self) -> float:
        return 1.0 - len(self.missed) / self.total if self.total else 1.0


def covered(all_of_it: Iterable[State | Arrow], taken: Iterable[State | Arrow]) -> Coverage:
    """What of `all_of_it` is not among `taken`; where a state stands does not matter."""
    everything, known = tuple(all_of_it), set(taken)
    missed = tuple(
        one
        for one in everything
        if (one._replace(at="") if isinstance(one, State) else one) not in known
    )
    return Coverage(len(everything), missed)
