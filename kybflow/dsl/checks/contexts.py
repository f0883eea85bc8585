"""What a vehicle's parts will be created with, for the checks that ask parts."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.document import VehicleEntry
from kybflow.world.vehicle_context import VehicleContext


def contexts(case: Case) -> Iterator[tuple[VehicleEntry, VehicleContext]]:
    """Every vehicle with its context, but for the tags, of which there may be thousands."""
    document = case.document
    vehicles = document.vehicles.items()
    obstacles = {use.name.text: use.shape for use in document.obstacles}
    diameters = {name: vehicle.airframe.diameter for name, vehicle in vehicles}
    starts = {name: vehicle.start for name, vehicle in vehicles}
    groups = {name: tuple(m.text for m in of) for name, of in document.groups.items()}
    for name, vehicle in vehicles:
        driver, airframe = vehicle.driver, vehicle.airframe
        context = VehicleContext(
            name, airframe, vehicle.start, vehicle.heading, document.fence,
            1.0 / document.control_rate, vehicle.home, obstacles, diameters,
            cameras={camera.name.text: camera.camera for camera in vehicle.cameras},
            payload=vehicle.payload,
            loop=driver.spec.cls.inner_loop(driver.params, airframe),
            starts=starts,
            groups=groups,
        )  # fmt: skip
        yield vehicle, context
