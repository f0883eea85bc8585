"""Where a plan leaves its vehicles when nothing but time passes: no event, no condition and no
failure. It walks the plan, not the document, and shares nothing with the checks."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.dsl.plan import Plan, StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import GROUND, MOVING


class End(NamedTuple):
    """How a vehicle ends: on the ground or not, and where, as far as that can be told."""

    grounded: bool
    position: Vec3 | None


def ending(plan: Plan) -> dict[str, End]:
    """How each vehicle ends."""
    return {vehicle.name: _end(vehicle) for vehicle in plan.vehicles}


def _end(vehicle: VehiclePlan) -> End:
    state, position, flight = vehicle.begin, vehicle.start, GROUND
    for _ in range(200):
        plan = vehicle.states[state]
        leg = next((leg for leg in plan.legs if leg.start is flight), plan.legs[0])
        params = plan.behavior.params
        footprint = None if position is None else plan.behavior.cls.footprint(params, position)
        arrow = _arrow(plan, footprint is not None and footprint.is_endless)
        if arrow is None:
            return End(flight is GROUND, position)
        flight = leg.end if arrow.cause == "then" or leg.start is leg.end else MOVING
        if leg.start is not GROUND or leg.end is not GROUND:
            position = None if footprint is None else footprint.exit
        state = arrow.target
    return End(False, None)


def _arrow(state: StatePlan, is_endless: bool) -> TransitionPlan | None:
    """The way out that time opens: the end of what has one, else the first wait."""
    for arrow in state.transitions:
        waits = arrow.after is not None and arrow.when is None and arrow.event is None
        if (arrow.cause == "then" and not is_endless) or (is_endless and waits):
            return arrow
    return None
