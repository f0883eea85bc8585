"""One ideal vehicle: its link, its battery, its payload, and what carries it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, from_heading, rotate_back
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    Imu,
    Measurement,
    MeasurementKind,
    Odometry,
    Payload,
    Pose,
    Position,
    Time,
    Truth,
)
from kybflow.drivers.kinematic.motion import KinematicState, moved, stopped
from kybflow.parts import ActiveFaults, Link, Seat
from kybflow.parts.link import Touch
from kybflow.world.battery import BatteryCharge
from kybflow.world.ground import FLOOR
from kybflow.world.vehicle_context import LEGS

REPORTED: Time = NS // 10
"""How often the battery is reported."""
LIFTED = 0.01
"""Metres above the ground from which a touch of it is a new one."""
NOISE = 1e-6
"""m/s^2, m: an IMU or a body that is twice the same counts as stuck."""


class IdealVehicle(Link):
    """A vehicle and the link to it. state: where it is. is_down: whether the ground carries it."""

    def __init__(self, seat: Seat) -> None:
        self.context = context = seat.context
        self.state = KinematicState(context.start, attitude=from_heading(context.heading))
        self.is_down, self._has_lifted = True, False
        self.faults = ActiveFaults(context.vehicle, _refuse)
        self.tell_touch: Callable[[Touch], None] = _untold
        self._command: Command | None = None
        self._charge = BatteryCharge(context.airframe, seat.params.battery)
        self._due: Time = 0
        self._kinds: frozenset[MeasurementKind] = frozenset()
        self._imu: Imu | None = None
        self._noise = NOISE
        self._arriving: list[Measurement] = []
        parcel = context.payload
        self._aboard = parcel is not None and parcel.aboard
        self._dropped: Vec3 | None = None
        if parcel is not None:
            self._arriving.append(Payload(0, not parcel.aboard, parcel.aboard))
            self._dropped = None if parcel.aboard else self._below(context.start)

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        self._kinds = kinds

    def read(self, now: Time) -> Sequence[Measurement]:
        arrived, self._arriving = self._arriving, []
        place, velocity, _, attitude, rates = self.state
        if self._imu is not None:
            arrived.append(self._imu)
            self._imu = None
        if Odometry in self._kinds:
            arrived.append(Odometry(now, place, velocity, attitude, rates, 0.0))
        if Pose in self._kinds:
            arrived.append(Pose(now, add(place, (0.0, 0.0, self._noise)), attitude))
        if Position in self._kinds:
            arrived.append(Position(now, place, ZERO))
        if now >= self._due:
            self._due = now + REPORTED
            arrived.append(Battery(now, self._charge.remaining, self._charge.voltage))
        return arrived

    def send(self, command: Command, now: Time) -> None:
        self._command = command

    def cut(self, now: Time) -> None:
        """Stop the rotors; disarmed commands follow."""

    def grip(self, is_open: bool, now: Time) -> None:
        if self.context.payload is None:
            raise Refused("it carries no payload")
        if is_open and self._aboard:
            self._aboard, self._dropped = False, self._below(self.state.position)
        elif not (is_open or self._is_armed):
            self._aboard, self._dropped = True, None
        self._arriving.append(Payload(now, is_open, self._aboard))

    def truth(self) -> Truth:
        place, velocity, _, attitude, rates = self.state
        parcel = self.context.payload
        if parcel is None:
            return Truth(place, velocity, attitude, rates)
        carried = add(place, (0.0, 0.0, 0.5 * parcel.size - LEGS))
        return Truth(place, velocity, attitude, rates, self._dropped or carried)

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        self.tell_touch = tell

    def move(self, now: Time, dt: float) -> None:
        """Do for `dt` seconds, which end at `now`, what was commanded last."""
        command, before, self._noise = self._command, self.state, -self._noise
        if command is None or (self.is_down and not command.armed):
            self.state = stopped(before, before.position, dt)
        else:
            self._fly(command, dt)
            self._charge.drain(self._mass * self.state.pull, dt)
        if Imu in self._kinds:
            self._imu = self._felt(now, dt)

    def _fly(self, command: Command, dt: float) -> None:
        before = self.state
        self.state = state = moved(before, command, self.context.airframe, self._mass, dt)
        x, y, z = state.position
        ground = self._ground(state.position, before.position[2])
        self.is_down = z <= ground
        self._has_lifted = self._has_lifted or z > ground + LIFTED
        if not self.is_down:
            return
        if self._has_lifted:
            self._has_lifted = False
            self.tell_touch(Touch("the floor", carries=True))
        self.state = stopped(before, (x, y, ground), dt)

    def _ground(self, place: Vec3, height: float) -> float:
        """Return the height of what would carry the vehicle at `place`, where it came to from
        `height`."""
        x, y, z = place
        from_above = max(z, height) + LEGS
        context = self.context
        arm, (sx, sy, start) = context.airframe.arm, context.start
        highest = min(FLOOR, start)
        if start > FLOOR and max(abs(x - sx), abs(y - sy)) <= 2.0 * arm and start <= from_above:
            highest = start
        for shape in context.obstacles.values():
            top = shape.top(x, y, arm) + LEGS
            if highest < top <= from_above:
                highest = top
        return highest

    def _felt(self, now: Time, dt: float) -> Imu:
        ax, ay, az = self.state.acceleration
        force = rotate_back(self.state.attitude, (ax, ay, az + GRAVITY + self._noise))
        return Imu(now, dt, force, self.state.rates)

    def _below(self, place: Vec3) -> Vec3:
        """Return where a payload that is let go at `place` comes to rest, its centre."""
        assert self.context.payload is not None
        (x, y, z), (vx, vy, _) = place, self.state.velocity
        ground = self._ground(place, z)
        falls = sqrt(2.0 * max(0.0, z - ground) / GRAVITY)
        return (x + vx * falls, y + vy * falls, ground - LEGS + 0.5 * self.context.payload.size)

    @property
    def _is_armed(self) -> bool:
        return self._command is not None and self._command.armed

    @property
    def _mass(self) -> float:
        parcel = self.context.payload
        more = parcel.mass if parcel is not None and self._aboard else 0.0
        return self.context.airframe.mass + more


def _refuse() -> None:
    raise DriverError("an ideal vehicle has no faults; fly on `sim`")


def _untold(touch: Touch) -> None:
    """Nobody wants to know."""
