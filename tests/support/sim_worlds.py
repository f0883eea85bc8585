"""A world with quadrotors in it, flown on the truth: for tests of the simulator alone."""

from __future__ import annotations

import random

from kybflow.core.geometry import LEVEL, ZERO, Vec3
from kybflow.core.signals import NS, Command
from kybflow.drivers.sim import Sim, SimParams
from kybflow.parts import Seat
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.05, diameter=0.5, inertia=(0.011, 0.011, 0.02), thrust=6.0, rotor_time=0.05, drag=0.25
)  # fmt: skip
PERIOD = NS // 250
QUIET = SimParams(
    calm=True, model_error=0.0, gyro_noise=0.0, gyro_bias=0.0, accelerometer_noise=0.0,
    accelerometer_bias=0.0,
)  # fmt: skip


def seat(name="a", at: Vec3 = ZERO, params=QUIET, airframe=FRAME, heading=0.0) -> Seat:
    return Seat(VehicleContext(name, airframe, at, heading, None, 0.004), params)


def world(*seats: Seat, seed=1):
    return Sim.open(seats or (seat(),), random.Random(seed))


def opened(*seats: Seat, seed=1):
    """A world, and its link `a`."""
    session = world(*seats, seed=seed)
    return session, session.links["a"]


def push(world, link, seconds, command, start=0):
    """Send `command` for `seconds`; everything measured meanwhile, and the time after it."""
    measured, now = [], start
    for _ in range(round(seconds * 250)):
        link.send(command, now)
        now += PERIOD
        world.advance(now)
        measured += link.read(now)
    return measured, now


def thrust(newtons, attitude=LEVEL, heading=0.0):
    return Command(attitude, newtons, ZERO, heading)


def touches(link):
    """What its vehicle begins to touch from now on, as a list that grows."""
    told = []
    link.report_touches(told.append)
    return told


STOPPED = Command(LEVEL, 0.0, ZERO, None, armed=False)


def hover_control(link, height):
    """A climb-rate law on the truth: this test is about the simulator, not about estimation."""
    state = link.truth()
    error = 4.0 * (height - state.position[2]) - 3.0 * state.velocity[2]
    return thrust(1.1 * FRAME.mass * (9.81 + error))


def lift(world, link, height=2.0, seconds=6.0, start=0):
    now = start
    for _ in range(round(seconds * 250)):
        link.send(hover_control(link, height), now)
        now += PERIOD
        world.advance(now)
    link.read(now)
    return now


def in_flight(params=QUIET, height=1.5, seconds=4.0, seed=1):
    """A session, its link `a` hovering at about `height`, and the time."""
    session, link = opened(seat(params=params), seed=seed)
    _, now = push(session, link, 0.5, STOPPED)
    return session, link, lift(session, link, height, seconds, now)
