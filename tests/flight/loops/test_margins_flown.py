"""The computed delay margin is that of the flight: with three quarters of it as an additional delay
of commands a simulated vehicle comes to rest, with five quarters it oscillates. A vehicle that is
weaker and slower than declared comes to rest as well."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import pytest
from plans import NANO
from sim_worlds import FRAME

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Setpoint, SetpointKind, Tick
from kybflow.drivers.sim import Sim, SimParams, vehicle
from kybflow.drivers.sim.lab import BuiltAirframe
from kybflow.flight.geometric_law import GeometricParams, outer_loop
from kybflow.flight.loops.margins import margins
from kybflow.flight.loops.position_loop import horizontal, vertical
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


COURIER = replace(FRAME, rotor_time=0.06)
MODELS = {0: horizontal, 2: vertical}
LATE = replace(DELAYED, command_latency=0.04)
OLD = replace(DELAYED, mocap_latency=0.06)


@pytest.mark.parametrize("axis", MODELS)
@pytest.mark.parametrize(
    ("frame", "params"),
    [
        pytest.param(FRAME, DELAYED, id="mk"),
        pytest.param(NANO, DELAYED, id="nano", marks=pytest.mark.thorough),
        pytest.param(as_px4(FRAME), DELAYED, id="as PX4", marks=pytest.mark.thorough),
        pytest.param(FRAME, LATE, id="late commands", marks=pytest.mark.thorough),
        pytest.param(FRAME, OLD, id="old poses", marks=pytest.mark.thorough),
    ],
)
def test_it_oscillates_within_a_quarter_of_the_computed_delay(frame, params, axis: int) -> None:
    site = context(frame, params)
    outer = outer_loop(GeometricParams(observer=0.0), frame, site.loop, site.dt)
    assert site.loop is not None
    margin = margins(MODELS[axis](outer, site.loop)).delay
    first, _, _, last = swings(frame, axis, 0.75 * margin, params)
    assert last < 0.3 * first, "it comes to rest"
    first, _, _, last = swings(frame, axis, 1.25 * margin, params)
    assert last > 3.0 * first, "it oscillates"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("frame", "inertia", "rotor_time"),
    [(FRAME, 1.33, 1.3), (FRAME, 1.15, 1.15), (NANO, 1.15, 1.15), (COURIER, 1.33, 1.3)],
    ids=["mk, worst", "mk", "nano", "courier, worst"],
)
def test_a_weaker_and_slower_vehicle_than_declared_comes_to_rest(
    frame, inertia: float, rotor_time: float, monkeypatch
) -> None:
    """Around a thrust that is 20 % lower than declared; the worst is a model error of 20 % on gains
    that are wrong by 10 %."""

    def weak(airframe: Airframe, error: float, generator: object) -> BuiltAirframe:
        moments = tuple(inertia * j for j in airframe.inertia)
        lag = rotor_time * airframe.rotor_time
        return BuiltAirframe(
            0.8 * airframe.mass, moments, (0.8 * airframe.thrust,) * 4, lag, airframe.drag
        )

    monkeypatch.setattr(vehicle, "build", weak)
    first, _, _, last = swings(frame, 0, 0.0)
    assert last < 0.1 * first
