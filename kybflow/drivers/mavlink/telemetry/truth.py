"""The ground truth from a firmware's own simulator, in the mission's world, and a simulated falling
parcel.

The simulator reports a geographic position. The first one reported while the vehicle is on the
ground is taken as the mission's start and heading, which anchors the simulator's world in the
mission's. A message is taken to be true at its arrival; between two messages the motion is
extrapolated. When messages stop there is no truth.

Geographic positions are rounded to 1e-7 degrees, 1.1 cm, and a tracker would read a velocity of 1
m/s from such a step. The velocity is finer, so the position follows the integral of the velocity.
An error within the rounding is corrected by the fraction `SMOOTHING_SHARE` per message; any excess
is corrected at once.

The firmware knows no parcel. While carried, the parcel has no weight, as in kybflow's own
simulator. Once released, it falls as a point without drag or bounce and comes to rest on the floor.
"""

from __future__ import annotations

from math import sqrt
from types import MappingProxyType

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Vec3,
    add,
    cross,
    heading_of,
    integrate,
    rotate,
    scale,
)
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.mavlink.protocol.codec import is_finite
from kybflow.drivers.mavlink.protocol.frames import (
    Anchor,
    Tangent,
    attitude_from_ned,
    from_frd,
    from_ned,
)
from kybflow.drivers.mavlink.protocol.framing import Message
from kybflow.drivers.sim.model import mount
from kybflow.world.vehicle_context import Parcel, VehicleContext

STREAMS = MappingProxyType({"SIM_STATE": 50.0, "HIL_STATE_QUATERNION": 50.0})
"""The messages that hold the truth, Hz; each firmware's simulator sends one of them."""
POSITION_STEP = 0.012
"""The largest rounding error of a reported position, metres."""
SMOOTHING_SHARE = 0.04
MAX_EXTRAPOLATION_S = 0.2
"""Seconds after a message for which the motion is extrapolated; after that there is no truth."""


class GroundTruth:
    """The ground truth of one vehicle. sphere: the radius of the earth in its simulator, metres;
    None if the simulator uses the WGS 84 ellipsoid."""

    def __init__(self, context: VehicleContext, sphere: float | None) -> None:
        self._context, self._sphere = context, sphere
        self._tangent: Tangent | None = None
        self._anchor = Anchor()
        self._newest: Truth | None = None
        self._at: Time = 0
        self._now: tuple[Time, Truth] | None = None  # `_newest` extrapolated to a time
        self._parcel = None if context.payload is None else _Fall(context.payload)

    def handle(self, message: Message, now: Time, *, on_ground: bool) -> None:
        """Handle a SIM_STATE or HIL_STATE_QUATERNION; other messages are ignored. on_ground:
        whether the vehicle reports that it is on the ground. There is no truth until it has
        been."""
        kind = message.get_type()
        if kind == "SIM_STATE":
            degrees = (message.lat_int * 1e-7, message.lon_int * 1e-7)
            height, speed = message.alt, (message.vn, message.ve, message.vd)
            turn = (message.q1, message.q2, message.q3, message.q4)
            rates = (message.xgyro, message.ygyro, message.zgyro)
        elif kind == "HIL_STATE_QUATERNION":
            degrees = (message.lat * 1e-7, message.lon * 1e-7)
            height = message.alt * 1e-3
            speed = (message.vx * 1e-2, message.vy * 1e-2, message.vz * 1e-2)
            w, x, y, z = message.attitude_quaternion
            turn = (w, x, y, z)
            rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
        else:
            return
        if not is_finite(*degrees, height, *speed, *turn, *rates):
            return
        attitude = attitude_from_ned(turn)
        if self._tangent is None:
            if not on_ground:
                return
            self._tangent = (
                Tangent.on_ellipsoid(*degrees, height)
                if self._sphere is None
                else Tangent.on_sphere(*degrees, height, self._sphere)
            )
            start, heading = self._context.start, self._context.heading
            self._anchor = Anchor.joining(ZERO, heading_of(attitude), start, heading)
        velocity = self._anchor.turned(from_ned(speed))
        place = self._anchor.to_world(self._tangent.local(*degrees, height))
        self._newest = Truth(
            self._followed(place, velocity, now),
            velocity,
            self._anchor.attitude_to_world(attitude),
            from_frd(rates),
        )
        self._at, self._now = now, None

    def truth(self, now: Time) -> Truth | None:
        """Return the true state of the vehicle and its parcel. Return None until the vehicle has
        been on the ground, and if no message arrived for `MAX_EXTRAPOLATION_S`."""
        vehicle = self._vehicle(now)
        if vehicle is None or self._parcel is None:
            return vehicle
        return vehicle._replace(payload=self._parcel.position(vehicle, now))

    def release(self, now: Time) -> None:
        """Release the parcel with its current velocity, or its last known one."""
        vehicle = self._vehicle(now) or self._newest
        if self._parcel is not None and vehicle is not None:
            self._parcel.release(vehicle, now)

    def load(self) -> None:
        """Put the parcel on board."""
        if self._parcel is not None:
            self._parcel.load()

    def _vehicle(self, now: Time) -> Truth | None:
        gone = max((now - self._at) / NS, 0.0)
        if self._newest is None or gone > MAX_EXTRAPOLATION_S:
            return None
        if self._now is None or self._now[0] != now:
            position, velocity, attitude, turn, payload = self._newest
            if gone:
                position = add(position, scale(velocity, gone))
                attitude = integrate(attitude, turn, gone)
            self._now = now, Truth(position, velocity, attitude, turn, payload)
        return self._now[1]

    def _followed(self, place: Vec3, velocity: Vec3, now: Time) -> Vec3:
        """Return the position with its rounding errors smoothed."""
        last, gone = self._newest, (now - self._at) / NS
        if last is None or gone > MAX_EXTRAPOLATION_S:
            return place
        mean = scale(add(last.velocity, velocity), 0.5)
        ahead = add(last.position, scale(mean, gone))
        (x, y, z), (a, b, c) = ahead, place
        return (_corrected(x, a), _corrected(y, b), _corrected(z, c))


def _corrected(ahead: float, reported: float) -> float:
    off = reported - ahead
    excess = off - max(-POSITION_STEP, min(off, POSITION_STEP))
    return ahead + excess + SMOOTHING_SHARE * (off - excess)


class _Fall:
    """A parcel: carried, or falling since its release. A parcel that was never carried lies on the
    floor where the vehicle first was."""

    def __init__(self, made: Parcel) -> None:
        self._hangs: Vec3 = (0.0, 0.0, mount(made))
        self._rests = mount(made)
        self._is_on_board = made.aboard
        self._released: tuple[Time, Vec3, Vec3] | None = None

    def load(self) -> None:
        self._is_on_board, self._released = True, None

    def release(self, vehicle: Truth, now: Time) -> None:
        if not self._is_on_board:
            return
        along = rotate(vehicle.attitude, cross(vehicle.angular_velocity, self._hangs))
        self._is_on_board = False
        self._released = (now, self._place(vehicle), add(vehicle.velocity, along))

    def position(self, vehicle: Truth, now: Time) -> Vec3:
        """Return the true position of the centre of the vehicle's payload."""
        if self._is_on_board:
            return self._place(vehicle)
        if self._released is None:
            self._released = (now, self._place(vehicle), ZERO)
        begun, (x, y, z), (vx, vy, vz) = self._released
        drop = max(z - self._rests, 0.0)
        falls = (vz + sqrt(vz * vz + 2.0 * GRAVITY * drop)) / GRAVITY if drop else 0.0
        gone = max((now - begun) / NS, 0.0)
        t = min(gone, falls)
        height = self._rests if gone >= falls else z + vz * t - 0.5 * GRAVITY * t * t
        return (x + vx * t, y + vy * t, height)

    def _place(self, vehicle: Truth) -> Vec3:
        return add(vehicle.position, rotate(vehicle.attitude, self._hangs))
