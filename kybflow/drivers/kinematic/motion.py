"""The motion of an ideal vehicle in one tick, in the world frame (ENU) and SI units."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    add,
    from_heading,
    from_thrust_direction,
    heading_of,
    integrate,
    norm,
    rotate,
    scale,
    sub,
    wrap,
)
from kybflow.core.signals import Command, CommandKind, Setpoint
from kybflow.world.vehicle_context import Airframe

SPEED_RESERVE = 2.0
"""Largest speed of a vehicle, as a multiple of its airframe's largest speed or climb rate,
whichever is larger."""
DOWN: Vec3 = (0.0, 0.0, -GRAVITY)


class KinematicState(NamedTuple):
    """The state of a vehicle. acceleration: that of the last tick."""

    position: Vec3
    velocity: Vec3 = ZERO
    acceleration: Vec3 = ZERO
    attitude: Quat = LEVEL
    rates: Vec3 = ZERO

    @property
    def pull(self) -> float:
        """Thrust over mass, m/s^2."""
        ax, ay, az = self.acceleration
        return norm((ax, ay, az + GRAVITY))


def moved(
    state: KinematicState, command: Command, airframe: Airframe, mass: float, dt: float
) -> KinematicState:
    """Return the state `dt` seconds later, ignoring the ground. mass: of the vehicle with its
    payload, kg."""
    if not command.armed:
        return _pushed(state, DOWN, state.attitude, ZERO, dt)
    if command.setpoint is not None:
        return _following(state, command.kind, command.setpoint, airframe, dt)
    attitude, rates = command.attitude, ZERO
    if command.kind is CommandKind.RATES_THRUST:
        attitude, rates = integrate(state.attitude, command.rates, dt), command.rates
    elif command.heading is None:
        attitude = from_thrust_direction(
            rotate(attitude, (0.0, 0.0, 1.0)), heading_of(state.attitude)
        )
    pull = rotate(attitude, (0.0, 0.0, command.thrust / mass))
    return _pushed(state, add(pull, DOWN), attitude, rates, dt)


def stopped(before: KinematicState, position: Vec3, dt: float) -> KinematicState:
    """Return the state of a vehicle that the ground has stopped at `position` during the tick."""
    level = from_heading(heading_of(before.attitude))
    return KinematicState(position, ZERO, scale(before.velocity, -1.0 / dt), level)


def _pushed(
    state: KinematicState, push: Vec3, attitude: Quat, rates: Vec3, dt: float
) -> KinematicState:
    (px, py, pz), (vx, vy, vz), (ax, ay, az) = state.position, state.velocity, push
    half = 0.5 * dt * dt
    place = (px + vx * dt + ax * half, py + vy * dt + ay * half, pz + vz * dt + az * half)
    return KinematicState(place, (vx + ax * dt, vy + ay * dt, vz + az * dt), push, attitude, rates)


def _following(
    state: KinematicState, kind: CommandKind, wanted: Setpoint, airframe: Airframe, dt: float
) -> KinematicState:
    """Return the state after following a setpoint, which applies to the beginning of the tick."""
    (ax, ay, az), rate = wanted.acceleration or ZERO, wanted.heading_rate
    before = heading_of(state.attitude) if wanted.heading is None else wanted.heading
    facing = from_thrust_direction((ax, ay, az + GRAVITY), wrap(before + rate * dt))
    turn = (0.0, 0.0, rate)
    start = wanted.position if kind is CommandKind.POSITION else state.position
    speed = state.velocity if kind is CommandKind.ACCELERATION else wanted.velocity
    target = _pushed(
        KinematicState(start or state.position, speed or ZERO), (ax, ay, az), facing, turn, dt
    )
    way = sub(target.position, state.position)
    most = SPEED_RESERVE * max(airframe.speed, airframe.climb) * dt
    length = norm(way)
    if length <= most:
        return target
    way = scale(way, most / length)
    return KinematicState(add(state.position, way), scale(way, 1.0 / dt), ZERO, facing, turn)
