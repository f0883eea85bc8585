"""A simulated vehicle that hovers by `geometric` on poses, and is put out of its place: for tests
of the loop alone, without a mission around it."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Setpoint, SetpointKind, Tick
from kybflow.drivers.sim import Sim, SimParams
from kybflow.flight.geometric_law import GeometricParams
from kybflow.parts import Effect, Seat
from kybflow.runtime.estimators.mocap import Mocap, MocapParams
from kybflow.runtime.trackers.geometric import Geometric
from kybflow.world.vehicle_context import Airframe, VehicleContext

PERIOD = NS // 250
SETTLED = 6.0
"""Seconds from which it hovers in its place."""

DELAYED = SimParams(
    calm=False, model_error=0.0, gyro_noise=0.0, gyro_bias=0.0, accelerometer_noise=0.0,
    accelerometer_bias=0.0, mocap_position_noise=1e-5, mocap_attitude_noise=1e-5, force_noise=0.0,
    torque_noise=0.0, drag_error=0.0, inflow=0.0, loop_error=0.0, command_jitter=0.0,
    mocap_misalignment=0.0, mocap_loss=0.0, stamp_error=0.0, stamp_jitter=0.0,
)  # fmt: skip
"""A lab that only delays: a model can know all of it."""


def context(frame: Airframe, params: SimParams) -> VehicleContext:
    loop = Sim.inner_loop(params, frame)
    return VehicleContext("a", frame, ZERO, 0.0, None, PERIOD / NS, loop=loop)


def swings(
    frame: Airframe,
    axis: int,
    more: float,
    params: SimParams = DELAYED,
    seconds: float = 8.0,
    **gains: float,
) -> Sequence[float]:
    """How far it swings, metres, in each quarter of the `seconds` after it was put 1 cm out of its
    place along an axis, from when on commands arrive `more` seconds later."""
    site = context(frame, params)
    session = Sim.open([Seat(site, params)], random.Random(1))
    link, estimator = session.links["a"], Mocap(MocapParams(), site)
    tracker = Geometric(GeometricParams(mass_guess=1.0, observer=0.0, **gains), site)
    places, now = [], 0
    for step in range(round((SETTLED + seconds) * NS / PERIOD)):
        now += PERIOD
        session.advance(now)
        estimate = estimator.update(link.read(now), now)
        if estimate is None:
            continue
        if step == round(SETTLED * NS / PERIOD) and more:
            link.faults.begin(Effect(late=more), now)
        setpoint = _where(now / NS, axis)
        tick = Tick(now, PERIOD / NS, 0.0, estimate, None, setpoint, {})
        link.send(tracker.update(setpoint, tick), now)
        if now / NS > SETTLED:
            places.append(link.truth().position[axis])
    quarter = len(places) // 4
    return [_swing(places[k * quarter : (k + 1) * quarter]) for k in range(4)]


def _where(seconds: float, axis: int) -> Setpoint:
    x, y, z = 0.0, 0.0, min(1.0, 0.5 * seconds)
    place: Vec3 = (x, y, z)
    if seconds > SETTLED:
        place = (x + 0.01, y, z) if axis == 0 else (x, y, z + 0.01)
    rising = (0.0, 0.0, 0.5 if seconds < 2.0 else 0.0)
    return Setpoint(SetpointKind.POSITION, place, rising, ZERO, ZERO, 0.0)


def _swing(places: Sequence[float]) -> float:
    return max(places) - min(places)


def as_px4(frame: Airframe) -> Airframe:
    """The airframe on an on-board loop as slow as PX4's."""
    return replace(frame, rotor_time=0.025, attitude_gain=6.5, rate_gain=18.0)
