"""The contexts with which the vehicles' parts are created, for checks that query the parts."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.plan import VehiclePlan
from kybflow.world.vehicle_context import VehicleContext


def contexts(case: Case) -> Iterator[tuple[VehiclePlan, VehicleContext]]:
    """Yield every vehicle with its context. The contexts have no tags, because there may be
    thousands."""
    plan = case.plan
    diameters = {vehicle.name: vehicle.airframe.diameter for vehicle in plan.vehicles}
    starts = {vehicle.name: vehicle.start for vehicle in plan.vehicles}
    for vehicle in plan.vehicles:
        driver, airframe = vehicle.driver, vehicle.airframe
        context = VehicleContext(
            vehicle.name, airframe, vehicle.start, vehicle.heading, plan.fence,
            1.0 / plan.control_rate, vehicle.home, plan.obstacles, diameters,
            cameras=vehicle.own_cameras,
            payload=vehicle.payload,
            loop=driver.cls.inner_loop(driver.params, airframe),
            starts=starts,
            groups=plan.groups,
        )  # fmt: skip
        yield vehicle, context
