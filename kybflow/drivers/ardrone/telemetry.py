"""A drone's latest status, and its battery, IMU and odometry measurements in the run's time.

The drone's frame is x forward, y right, z down, with the heading clockwise. Attitude and speeds are
converted to FLU here (as in `ardrone_autonomy`: pitch, heading, v_y and v_z negated). The drone
reports no position. The horizontal position is integrated from the speed of the optical flow; the
height above the ground at the start comes from the ultrasound. Both begin at the mission's start.
The position's standard deviation starts at `INITIAL_SPREAD` and grows by `DRIFT` of the distance
flown."""

from __future__ import annotations

from math import hypot, isfinite, radians

from kybflow.core.clock_offset import Offset
from kybflow.core.geometry import GRAVITY, Vec3, from_euler, from_heading, rotate, wrap
from kybflow.core.signals import NS, Battery, BatteryWarning, Imu, Measurement, Odometry, Time
from kybflow.drivers.ardrone.navdata import (
    ALARMS,
    FOLLOWING,
    WRAP_S,
    Demo,
    DroneState,
    OptionTag,
    Packet,
    Phase,
    PhysMeasures,
    decoded,
    demo,
    drone_time,
    in_words,
    phys_measures,
)
from kybflow.parts import StatusText
from kybflow.world.vehicle_context import VehicleContext

WARNINGS = frozenset({DroneState.BATTERY_LOW, DroneState.USER_EMERGENCY})
"""The alarms that are reported as warnings only."""
MOST_TEXTS = 100
"""Largest number of unread texts."""


class DroneStatus:
    """The status of one drone.

    state: the latest state mask. demo: the latest demo option, None before the first.
    last_received: when the latest packet arrived.
    """

    def __init__(self) -> None:
        self.state = DroneState(0)
        self.demo: Demo | None = None
        self.last_received: Time | None = None
        self._texts: list[StatusText] = []

    def receive(self, packet: Packet, now: Time) -> None:
        begun = packet.state & ~self.state
        self.state, self.last_received = packet.state, now
        self.demo = demo(packet.options) or self.demo
        for bit in ALARMS:
            if begun & bit and len(self._texts) < MOST_TEXTS:
                severity = "warning" if bit in WARNINGS else "critical"
                self._texts.append(StatusText(severity, in_words(bit)[0]))

    def texts(self) -> list[StatusText]:
        """Return the messages added since the last call."""
        texts, self._texts = self._texts, []
        return texts

    @property
    def phase(self) -> Phase:
        return Phase.DEFAULT if self.demo is None else self.demo.phase

    @property
    def flies(self) -> bool:
        """Whether the drone is in the air, is taking off or is landing."""
        return DroneState.FLYING in self.state

    @property
    def follows(self) -> bool:
        """Whether the drone obeys commands to move now."""
        return self.flies and self.phase in FOLLOWING

    @property
    def stands(self) -> bool:
        """Whether the drone is on the ground with its rotors stopped."""
        return not self.flies

    @property
    def is_in_emergency(self) -> bool:
        return DroneState.EMERGENCY in self.state

    @property
    def acknowledges(self) -> bool:
        """Whether the drone has applied a configuration value and waits for the acknowledge bit to
        be reset."""
        return DroneState.COMMAND_ACKNOWLEDGED in self.state


INITIAL_SPREAD, DRIFT = 0.05, 0.1
"""Standard deviation of the integrated position: at the start, m, and its growth per metre flown,
m."""
BATTERY_PERIOD: Time = NS
EMPTY_VOLTAGE, VOLTAGE_SPAN = 9.0, 3.6
"""Voltage at which the drone lands, and by how much that of a full battery is higher. They give an
estimate if the drone doesn't report the voltage."""
MOST_STEP = 0.5
"""Largest gap between two packets over which to integrate, seconds."""


class DroneClock:
    """Converts a drone's time stamps to the run's time by the least delay
    (`kybflow.core.clock_offset`), because Wi-Fi delivers some packets 40 ms later than others. dt:
    seconds between the newest two packets; zero after a gap."""

    def __init__(self) -> None:
        self.dt = 0.0
        self._offset = Offset()
        self._read: float | None = None
        self._run: Time = 0
        self._last_received: Time | None = None
        self._stamped: Time = 0

    def stamp(self, read: float | None, now: Time) -> Time:
        """Return when a packet that arrived at `now` was sent, which is never in the future or
        before the last packet. read: the drone's time in seconds, which wraps; if None, the packet
        counts as sent at `now`."""
        last, self._last_received = self._last_received, now
        if read is None:
            passed = 0.0 if last is None else (now - last) / NS
            sent = now
        else:
            passed = 0.0 if self._read is None else (read - self._read) % WRAP_S
            self._read = read
            self._run += round(passed * NS)
            sent = min(now, self._run + self._offset.of(now, self._run))
        self.dt = passed if passed <= MOST_STEP else 0.0
        self._stamped = max(self._stamped, sent)
        return self._stamped


class Measurements:
    """Collects the measurements of one drone until they are read."""

    def __init__(self, context: VehicleContext) -> None:
        self._context = context
        self._pending: list[Measurement] = []
        self._clock = DroneClock()
        self._turned: float | None = None
        self._place: tuple[float, float] = (context.start[0], context.start[1])
        self._ground: float | None = None
        self._spread = INITIAL_SPREAD
        self._rates: Vec3 = (0.0, 0.0, 0.0)
        self._last_report: tuple[float, bool] | None = None
        self._reported: Time = 0

    def receive(self, packet: Packet, now: Time) -> None:
        """Process a packet that arrived at `now`."""
        sent = self._clock.stamp(drone_time(packet.options), now)
        dt = self._clock.dt
        sensed = phys_measures(packet.options)
        if sensed is not None:
            self._add_imu(sensed, dt, sent)
        known = demo(packet.options)
        if known is not None:
            self._move(known, DroneState.FLYING in packet.state, dt, sent)
            self._charge(known, packet, now)

    def take(self) -> list[Measurement]:
        """Return the measurements made since the last call, oldest first."""
        taken, self._pending = self._pending, []
        return taken

    def _add_imu(self, sensed: PhysMeasures, dt: float, sent: Time) -> None:
        (ax, ay, az), (gx, gy, gz) = sensed
        if dt <= 0.0 or not isfinite(ax + ay + az + gx + gy + gz):
            return
        unit = GRAVITY / 1000.0
        self._rates = (radians(gx), -radians(gy), -radians(gz))
        self._pending.append(Imu(sent, dt, (unit * ax, -unit * ay, -unit * az), self._rates))

    def _move(self, known: Demo, flies: bool, dt: float, sent: Time) -> None:
        """Integrate the position, and add an odometry measurement."""
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
        measured = 0.001 * known.altitude
        if not flies or self._ground is None:
            self._ground = min(measured, 0.3)
        z = self._context.start[2] + (measured - self._ground)
        climb = -vz if flies else 0.0
        velocity = (level[0], level[1], climb)
        self._pending.append(
            Odometry(sent, (x, y, z), velocity, attitude, self._rates, self._spread)
        )

    def _charge(self, known: Demo, packet: Packet, now: Time) -> None:
        share, is_low = known.battery / 100.0, DroneState.BATTERY_LOW in packet.state
        if (share, is_low) == self._last_report and now - self._reported < BATTERY_PERIOD:
            return
        self._last_report, self._reported = (share, is_low), now
        raw = decoded(OptionTag.RAW_MEASURES, packet.options.get(OptionTag.RAW_MEASURES, b""))
        measured = raw.get("battery_millivolts")
        voltage = EMPTY_VOLTAGE + VOLTAGE_SPAN * share
        if isinstance(measured, int):
            voltage = measured / 1000.0
        warning = BatteryWarning("it reports its battery as low", True) if is_low else None
        self._pending.append(Battery(now, max(0.0, min(1.0, share)), voltage, warning))
