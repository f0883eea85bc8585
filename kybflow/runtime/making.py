"""The parts of a vehicle's plan, and how they are made."""

from __future__ import annotations

from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.dsl.plan import PartPlan, VehiclePlan
from kybflow.world.vehicle_context import VehicleContext


def parts_of(plan: VehiclePlan) -> list[PartPlan]:
    """Every part of a vehicle but its driver."""
    return [
        *(estimator.part for estimator in plan.estimators),
        *plan.processors,
        plan.tracker,
        *plan.supervisors,
        *(state.behavior for state in plan.states.values()),
    ]


def make(part: PartPlan, params: Any, context: VehicleContext) -> Any:
    """An estimator, processor, tracker or supervisor. Raises PartFailed when its constructor
    raises, whatever that was."""
    try:
        return part.cls(params, context)
    except Exception as error:
        raise PartFailed(part.label, error) from error
