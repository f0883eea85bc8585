"""Who sees the moving obstacles: a motion-capture system that a vehicle is tracked by, or a
simulated one, where all vehicles are simulated and none is tracked by a system that could."""

from __future__ import annotations

import random
from collections.abc import Mapping
from functools import partial

from kybflow.core.errors import DriverError
from kybflow.dsl.plan import PartPlan, Plan
from kybflow.parts import Link, Stream
from kybflow.sensors._simulated_ball import SimulatedBall
from kybflow.sensors.simulated_motion_capture import (
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams,
)
from kybflow.world.vehicle_context import VehicleContext

_SIMULATED = PartPlan(
    "simulated_motion_capture",
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams(),
    "simulated_motion_capture",
)


def watching_streams(
    plan: Plan, links: Mapping[str, Link], context: VehicleContext, seed: int
) -> dict[str, Stream]:
    """What gives the poses of each moving obstacle, by name. links: the vehicles', by name.
    context: that of any of them. Raises DriverError, and nothing is open then."""
    opened: dict[str, Stream] = {}
    try:
        for name, ball in plan.moving.items():
            vehicle, part = plan.watching.get(name, ("", _SIMULATED))
            own = random.Random(f"{seed} obstacle {name}")
            opens = partial(_opened, part, context._replace(vehicle=name), own)
            is_simulated = part.cls.simulated
            opened[name] = SimulatedBall(ball, opens) if is_simulated else opens(links[vehicle])
    except BaseException:
        for stream in opened.values():
            stream.close()
        raise
    return opened


def _opened(part: PartPlan, context: VehicleContext, own: random.Random, link: Link) -> Stream:
    try:
        stream: Stream = part.cls.open(part.params, context, link, own)
    except DriverError as error:
        raise DriverError(f"`{part.name}` ({part.at}): {error}") from error
    return stream
