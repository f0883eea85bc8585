"""Navigation data as measurements: battery, inertial sensors, and the drone's own motion.

The drone's frame is x forward, y right, z down, its heading clockwise; its attitude and speeds are
turned into FLU here (as `ardrone_autonomy` does: pitch, heading, v_y and v_z negated). It knows no
position: its own is summed up from its horizontal speed, as its optical flow measures that, and the
height is its ultrasound's, above the ground at the start. Both begin at the mission's start. What
is summed up is worse with the way flown: `DRIFT` of it, and `FIRST`.
"""

from __future__ import annotations

from math import hypot, isfinite, radians

from kybflow.core.clock_offset import Offset
from kybflow.core.geometry import GRAVITY, Vec3, from_euler, from_heading, rotate, wrap
from kybflow.core.signals import NS, Battery, BatteryWarning, Imu, Measurement, Odometry, Time
from kybflow.drivers.ardrone.protocol.navdata.layouts import OptionTag, decoded
from kybflow.drivers.ardrone.protocol.navdata.options import (
    WRAPS,
    Demo,
    PhysMeasures,
    demo,
    drone_time,
    phys_measures,
)
from kybflow.drivers.ardrone.protocol.navdata.packet import Packet
from kybflow.drivers.ardrone.protocol.navdata.state import DroneState
from kybflow.world.vehicle_context import VehicleContext

FIRST, DRIFT = 0.05, 0.1
"""Standard deviation of its own position: at the start, m, and per metre flown."""
BATTERY_PERIOD: Time = NS
LOWEST, SPAN = 9.0, 3.6
"""The voltage at which it lands, and what a full pack has more; where it sends no voltage."""
MOST_STEP = 0.5
"""Seconds between two packets over which a motion is summed up."""


class DroneClock:
    """Brings a drone's stamps to the run's time. `dt`: seconds from the packet before to the newest
    one, zero where there was none for too long."""

    def __init__(self) -> None:
        self.dt = 0.0
        self._offset = Offset()
        self._read: float | None = None
        self._run: Time = 0
        self._heard: Time | None = None
        self._stamped: Time = 0

    def stamp(self, read: float | None, now: Time) -> Time:
        """When a packet was sent that arrived now: never in the future, and never before the one
        before. read: the drone's time, seconds, which wraps; None where the packet has none, which
        counts as sent now."""
        heard, self._heard = self._heard, now
        if read is None:
            passed = 0.0 if heard is None else (now - heard) / NS
            sent = now
        else:
            passed = 0.0 if self._read is None else (read - self._read) % WRAPS
            self._read = read
            self._run += round(passed * NS)
            sent = min(now, self._run + self._offset.of(now, self._run))
        self.dt = passed if passed <= MOST_STEP else 0.0
        self._stamped = max(self._stamped, sent)
        return self._stamped


class Measurements:
    """The measurements of one drone, collected until they are read."""

    def __init__(self, context: VehicleContext) -> None:
        self._context = context
        self._taken: list[Measurement] = []
        self._clock = DroneClock()
        self._turned: float | None = None
        self._place: tuple[float, float] = (context.start[0], context.start[1])
        self._floor: float | None = None
        self._spread = FIRST
        self._rates: Vec3 = (0.0, 0.0, 0.0)
        self._said: tuple[float, bool] | None = None
        self._reported: Time = 0

    def hear(self, packet: Packet, now: Time) -> None:
        """Take in one packet, which arrived at `now`."""
        sent = self._clock.stamp(drone_time(packet.options), now)
        dt = self._clock.dt
        felt = phys_measures(packet.options)
        if felt is not None:
            self._feel(felt, dt, sent)
        known = demo(packet.options)
        if known is not None:
            self._move(known, DroneState.FLYING in packet.state, dt, sent)
            self._charge(known, packet, now)

    def take(self) -> list[Measurement]:
        """The measurements since the last call, oldest first."""
        taken, self._taken = self._taken, []
        return taken

    def _feel(self, felt: PhysMeasures, dt: float, sent: Time) -> None:
        (ax, ay, az), (gx, gy, gz) = felt
        if dt <= 0.0 or not isfinite(ax + ay + az + gx + gy + gz):
            return
        unit = GRAVITY / 1000.0
        self._rates = (radians(gx), -radians(gy), -radians(gz))
        self._taken.append(Imu(sent, dt, (unit * ax, -unit * ay, -unit * az), self._rates))

    def _move(self, known: Demo, flies: bool, dt: float, sent: Time) -> None:
        """Sum up where it is."""
        vx, vy, vz = (0.001 * v for v in known.velocity)
        total = known.roll + known.pitch + known.heading + vx + vy + vz
        if not isfinite(total):
            return
        own = -radians(0.001 * known.heading)
        if self._turned is None:
            self._turned = self._context.heading - own
        heading = wrap(own + self._turned)
        attitude = from_euler(radians(0.001 * known.roll), -radians(0.001 * known.pitch), heading)
        level = rotate(from_heading(heading), (vx, -vy, 0.0)) if flies else (0.0, 0.0, 0.0)
        x, y = self._place[0] + dt * level[0], self._place[1] + dt * level[1]
        self._place = (x, y)
        self._spread += DRIFT * dt * hypot(level[0], level[1])
        z = self._context.start[2] + self._height(0.001 * known.altitude, flies)
        climb = -vz if flies else 0.0
        velocity = (level[0], level[1], climb)
        self._taken.append(Odometry(sent, (x, y, z), velocity, attitude, self._rates, self._spread))

    def _height(self, measured: float, flies: bool) -> float:
        """The height above the start."""
        if not flies or self._floor is None:
            self._floor = min(measured, 0.3)
        return measured - self._floor

    def _charge(self, known: Demo, packet: Packet, now: Time) -> None:
        share, is_low = known.battery / 100.0, DroneState.BATTERY_LOW in packet.state
        if (share, is_low) == self._said and now - self._reported < BATTERY_PERIOD:
            return
        self._said, self._reported = (share, is_low), now
        raw = decoded(OptionTag.RAW_MEASURES, packet.options.get(OptionTag.RAW_MEASURES, b""))
        measured = raw.get("battery_millivolts")
        voltage = LOWEST + SPAN * share
        if isinstance(measured, int):
            voltage = measured / 1000.0
        warning = BatteryWarning("it reports its battery as low", True) if is_low else None
        self._taken.append(Battery(now, max(0.0, min(1.0, share)), voltage, warning))
