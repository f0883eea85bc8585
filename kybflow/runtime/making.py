"""Constructs the parts of a vehicle's plan."""

from __future__ import annotations

from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.dsl.plan import PartPlan
from kybflow.world.vehicle_context import VehicleContext


def make(part: PartPlan, params: Any, context: VehicleContext) -> Any:
    """Construct an estimator, processor, tracker or supervisor. Raises PartFailed if its
    constructor raises."""
    try:
        return part.cls(params, context)
    except (Exception, SystemExit) as error:
        raise PartFailed(part.label, error) from error
