"""Every state of every plan, built-in ones too, leads to the ground: by its own arrows, when it
fails, and when nothing but time passes. Asked of the plan, apart from the checks."""

from __future__ import annotations

from pathlib import Path

import pytest
from plan_endings import ending
from toolchain import SHIPPED, compiled

from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND, MOVING, Flight

Node = tuple[str, Flight]


def plan_of(path: Path):
    return compiled(path)


def successors(vehicle: VehiclePlan, node: Node, failing: bool) -> set[Node]:
    """Where the arrows lead from a state as it is entered; only its failure, or all but that."""
    state = vehicle.states[node[0]]
    found: set[Node] = set()
    for leg in (leg for leg in state.legs if leg.start is node[1]):
        early = leg.end if leg.start is leg.end else MOVING
        for arrow in state.transitions:
            if (arrow.cause == "failed") is failing:
                found.add((arrow.target, leg.end if arrow.cause == "then" else early))
    return found


def reached(vehicle: VehiclePlan, node: Node, failing: bool) -> set[Node]:
    found, waiting = {node}, [node]
    while waiting:
        for successor in successors(vehicle, waiting.pop(), failing) - found:
            found.add(successor)
            waiting.append(successor)
    return found


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_state_and_every_failure_leads_to_the_ground(path: Path) -> None:
    for vehicle in plan_of(path).vehicles:
        nodes = {(name, leg.start) for name, s in vehicle.states.items() for leg in s.legs}
        for node in nodes:
            for failing in (False, True):
                after = reached(vehicle, node, failing)
                ways = {n for other in after for n in reached(vehicle, other, False)}
                assert any(flight is GROUND for _, flight in ways), (vehicle.name, node, failing)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_with_nothing_but_time_every_vehicle_ends_on_the_ground(path: Path) -> None:
    plan = plan_of(path)
    ends = ending(plan)
    assert all(end.grounded for end in ends.values())
