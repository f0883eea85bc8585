"""Ideal vehicles: their motion, batteries and payloads, the ground below them, and collisions.

Motion is in the world frame (ENU) and SI units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, combinations
from math import cos, pi, sin, sqrt
from typing import NamedTuple

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    add,
    distance,
    dot,
    from_heading,
    from_thrust_direction,
    heading_of,
    integrate,
    norm,
    rotate,
    rotate_back,
    scale,
    sub,
    wrap,
)
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    CommandKind,
    Imu,
    Measurement,
    MeasurementKind,
    Odometry,
    Payload,
    Pose,
    Position,
    Setpoint,
    Time,
    Truth,
)
from kybflow.drivers.kinematic.objects import IdealObjects, Pressing
from kybflow.parts import ActiveFaults, Link, Seat, Session
from kybflow.parts.link import Touch
from kybflow.world.ground import FLOOR
from kybflow.world.shapes import Sphere
from kybflow.world.vehicle_context import LEGS, Airframe, BatteryCharge

SPEED_RESERVE = 2.0
"""Largest speed of a vehicle, as a multiple of its airframe's largest speed or climb rate,
whichever is larger."""
DOWN: Vec3 = (0.0, 0.0, -GRAVITY)


class KinematicState(NamedTuple):
    """The state of a vehicle. acceleration: the acceleration during the last tick."""

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
    if wanted.presses is not None:
        ax = ay = 0.0  # what it presses against carries it
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


BATTERY_PERIOD: Time = NS // 10
"""Period of battery reports."""
LIFT_OFF = 0.01
"""Height above the ground, metres, that a vehicle must exceed before a touchdown counts as a new
touch."""
ALTERNATING_ERROR = 1e-6
"""Alternating error of IMU samples, m/s^2, and poses, m, because two equal samples would count as
stuck."""
DISC = ((0.0, 0.0), *((cos(n * pi / 4), sin(n * pi / 4)) for n in range(8)))
"""The points of a vehicle's disc that are tested for collisions, in radii from its centre."""


class IdealVehicle(Link):
    """An ideal vehicle and the link to it. is_down: whether it stands on the ground."""

    def __init__(self, seat: Seat) -> None:
        self.context = context = seat.context
        self.state = KinematicState(context.start, attitude=from_heading(context.heading))
        self.is_down, self._has_lifted = True, False
        self.faults = ActiveFaults(context.vehicle, _refuse)
        self.on_touch: Callable[[Touch], None] = lambda _: None
        self._command: Command | None = None
        self._charge = BatteryCharge(context.airframe, seat.params.battery)
        self._due: Time = 0
        self._kinds: frozenset[MeasurementKind] = frozenset()
        self._imu: Imu | None = None
        self._noise = ALTERNATING_ERROR
        self._arriving: list[Measurement] = []
        parcel = context.payload
        self._on_board = parcel is not None and parcel.aboard
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
            self._due = now + BATTERY_PERIOD
            arrived.append(Battery(now, self._charge.remaining, self._charge.voltage))
        return arrived

    def send(self, command: Command, now: Time) -> None:
        self._command = command

    def cut(self, now: Time) -> None:
        """Do nothing: the disarmed commands that follow stop the motors."""

    def grip(self, is_open: bool, now: Time) -> None:
        if self.context.payload is None:
            raise Refused("it carries no payload")
        if is_open and self._on_board:
            self._on_board, self._dropped = False, self._below(self.state.position)
        elif not (is_open or (self._command is not None and self._command.armed)):
            self._on_board, self._dropped = True, None
        self._arriving.append(Payload(now, is_open, self._on_board))

    def truth(self) -> Truth:
        place, velocity, _, attitude, rates = self.state
        parcel = self.context.payload
        if parcel is None:
            return Truth(place, velocity, attitude, rates)
        carried = add(place, (0.0, 0.0, 0.5 * parcel.size - LEGS))
        return Truth(place, velocity, attitude, rates, self._dropped or carried)

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        self.on_touch = tell

    def pressing(self) -> Iterator[Pressing]:
        """Yield where it presses with a force, if it does."""
        wanted = self._command.setpoint if self._command is not None else None
        if wanted is None or wanted.presses is None:
            return
        push = dot(wanted.acceleration or ZERO, wanted.presses) * self.context.airframe.mass
        if push > 0.0:
            yield self.context, self.state.position, scale(wanted.presses, push)

    def move(self, now: Time, dt: float) -> None:
        """Follow the last command for `dt` seconds that end at `now`."""
        command, before, self._noise = self._command, self.state, -self._noise
        if command is None or (self.is_down and not command.armed):
            self.state = stopped(before, before.position, dt)
        else:
            self._fly(command, dt)
            self._charge.drain(self._mass * self.state.pull, dt)
        if Imu in self._kinds:
            ax, ay, az = self.state.acceleration
            force = rotate_back(self.state.attitude, (ax, ay, az + GRAVITY + self._noise))
            self._imu = Imu(now, dt, force, self.state.rates)

    def _fly(self, command: Command, dt: float) -> None:
        before = self.state
        self.state = state = moved(before, command, self.context.airframe, self._mass, dt)
        x, y, z = state.position
        ground = self._ground(state.position, before.position[2])
        self.is_down = z <= ground
        self._has_lifted = self._has_lifted or z > ground + LIFT_OFF
        if not self.is_down:
            return
        if self._has_lifted:
            self._has_lifted = False
            self.on_touch(Touch("the floor", carries=True))
        self.state = stopped(before, (x, y, ground), dt)

    def _ground(self, place: Vec3, height: float) -> float:
        """Return the height at which the ground stops a vehicle at `place` that comes from
        `height`, metres."""
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

    def _below(self, place: Vec3) -> Vec3:
        """Return the position at which the centre of a payload released at `place` comes to
        rest."""
        assert self.context.payload is not None
        (x, y, z), (vx, vy, _) = place, self.state.velocity
        ground = self._ground(place, z)
        falls = sqrt(2.0 * max(0.0, z - ground) / GRAVITY)
        return (x + vx * falls, y + vy * falls, ground - LEGS + 0.5 * self.context.payload.size)

    @property
    def _mass(self) -> float:
        parcel = self.context.payload
        more = parcel.mass if parcel is not None and self._on_board else 0.0
        return self.context.airframe.mass + more


_Pair = tuple[IdealVehicle, str]


class KinematicWorld(Session):
    """Moves vehicles and obstacles, and reports collisions.

    Two vehicles collide if their distance is less than the sum of their arms. A vehicle collides
    with an obstacle that intersects the disc through its hubs; its legs may stand on an obstacle
    below.
    """

    def __init__(self, seats: Sequence[Seat]) -> None:
        self._vehicles = [IdealVehicle(seat) for seat in seats]
        self.links: dict[str, Link] = {v.context.vehicle: v for v in self._vehicles}
        self._now: Time = 0
        self._touching: frozenset[_Pair] = frozenset()
        self._pairs = tuple(
            (one, other, one.context.airframe.arm + other.context.airframe.arm)
            for one, other in combinations(self._vehicles, 2)
        )
        self._moving = {n: ball for seat in seats for n, ball in seat.context.moving.items()}
        objects = seats[0].context.objects if seats else {}
        self._objects = self.scene = IdealObjects(objects) if objects else None

    def advance(self, now: Time) -> None:
        dt, self._now = (now - self._now) / NS, now
        for vehicle in self._vehicles:
            vehicle.move(now, dt)
        if self._objects is not None:
            self._objects.advance((p for v in self._vehicles for p in v.pressing()), dt)
        touching = frozenset(self._touches())
        if touching != self._touching:
            before, self._touching = self._touching, touching
            for vehicle, into in sorted(
                touching - before, key=lambda t: (t[0].context.vehicle, t[1])
            ):
                vehicle.on_touch(Touch(into, carries=False))

    def close(self) -> None:
        """There is nothing to release."""

    def _touches(self) -> Iterator[_Pair]:
        balls = {
            name: Sphere(ball.at(self._now / NS), ball.radius)
            for name, ball in self._moving.items()
        }
        for one, other, apart in self._pairs:
            near = distance(one.state.position, other.state.position) < apart
            if near and not (one.is_down and other.is_down):
                yield one, other.context.vehicle
                yield other, one.context.vehicle
        for vehicle in self._vehicles:
            place, arm = vehicle.state.position, vehicle.context.airframe.arm
            x, y, z = place
            for name, shape in chain(vehicle.context.obstacles.items(), balls.items()):
                if shape.distance(place) < arm and any(
                    shape.distance((x + arm * c, y + arm * s, z)) < 0.0 for c, s in DISC
                ):
                    yield vehicle, name


def _refuse() -> None:
    raise DriverError("an ideal vehicle has no faults; fly on `sim`")
