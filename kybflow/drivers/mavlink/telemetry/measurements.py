"""The measurements of one autopilot: its own estimate, its IMU, its battery, its GPS and the
pilot's sticks. Values that are not finite, and quaternions that do not represent a rotation, are
dropped.

If the autopilot provides its own position, its frame is anchored in the world as soon as it has a
valid position on the ground: the vehicle then stands at the mission's start, with the mission's
heading. An autopilot that reboots begins another frame; once the vehicle has flown, the anchor of
that frame stays unknown.

An autopilot reports a low battery in BATTERY_STATUS (charge_state), in SYS_STATUS (an unhealthy
battery) and in texts. A reported state counts while it lasts; a text counts from arming until
disarming, since earlier ones belong to the preflight. The autopilot reports a low battery even if
its failsafe is disabled. If the failsafe is enabled, it acts from the state `acts_at` onwards."""

from __future__ import annotations

from collections.abc import Callable, Set
from types import MappingProxyType

from kybflow.core.signals import (
    NS,
    Battery,
    BatteryWarning,
    Imu,
    Measurement,
    MeasurementKind,
    Odometry,
    Payload,
    Time,
)
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.frames import IDENTITY, Anchor, Tangent, from_ned
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink
from kybflow.drivers.mavlink.telemetry.clocks import BootClock, boot_time
from kybflow.drivers.mavlink.telemetry.received_status import (
    LandedState,
    ReceivedStatus,
    ReceivedText,
)
from kybflow.world.vehicle_context import VehicleContext

MOTION = ("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED")
"""The messages that hold the autopilot's own estimate."""
INERTIAL = ("RAW_IMU", "SCALED_IMU", "HIGHRES_IMU")
"""IMU messages, the best last: once a better one has arrived, worse ones are dropped."""
STATUS = frozenset({"ESTIMATOR_STATUS", "EKF_STATUS_REPORT"})
"""The messages in which autopilots report the state of their estimator; each firmware sends one of
them."""
MOTION_RATE, INERTIAL_RATE = 50.0, 100.0
"""Rates, Hz, of the messages with which the vehicle is flown."""
IDLE_RATE_HZ = 25.0
"""Rate, Hz, of the same messages if the vehicle is not flown with them. It suffices to learn the
drift of the autopilot's frame and the resting bias of its IMU, to hold still, and to begin a blind
descent until the rate is raised."""
MAX_AGE_NS: Time = 2 * NS
"""The greatest age at which an attitude is combined with a position."""


class Telemetry:
    """Collects the measurements of one autopilot until they are taken.

    anchor: where the autopilot's own frame lies in the world, None while unknown.
    odometry: the autopilot's newest own estimate.
    spread: the standard deviation of its position, metres, None while it has no position.
    spread_of: reads `spread` from the autopilot's estimator status.
    streams: the messages that may be requested from the autopilot.
    """

    def __init__(
        self,
        context: VehicleContext,
        spread_of: Callable[[Message], float | None],
        streams: Set[str],
        battery: BatteryReports,
        status: ReceivedStatus,
        clock: BootClock,
        is_outside: bool,
    ) -> None:
        self.anchor: Anchor | None = IDENTITY if is_outside else None
        self.odometry: Odometry | None = None
        self.spread: float | None = None
        self._context, self._spread_of = context, spread_of
        self._status, self._clock, self._is_outside = status, clock, is_outside
        self._attitude: Message | None = None
        self._turn: Message | None = None
        self._reboots, self._has_flown = clock.reboots, False
        self._inertial = 0
        self._imu: Time | None = None
        self._origin: Tangent | None = None
        self._taken: list[Measurement] = []
        self._handlers: dict[str, Callable[[Message, Time], Measurement | None]] = {
            "ATTITUDE_QUATERNION": self._attitude_quaternion,
            "LOCAL_POSITION_NED": self._local_position,
            **dict.fromkeys(STATUS & streams, self._estimator_status),
            "BATTERY_STATUS": battery.handle,
            "SYS_STATUS": battery.handle,
            "GPS_GLOBAL_ORIGIN": self._global_origin,
            **({} if is_outside else {"GPS_RAW_INT": self._gps}),
            "RC_CHANNELS": codec.sticks,
            "MANUAL_CONTROL": codec.sticks,
            **dict.fromkeys(INERTIAL, self._inertial_sample),
        }
        if context.payload is not None:
            self._taken.append(Payload(0, not context.payload.aboard, context.payload.aboard))

    @property
    def heading(self) -> float | None:
        """The vehicle's heading in the autopilot's own frame, in the ENU convention, radians; None
        before the first valid attitude."""
        return None if self._turn is None else codec.own_heading(self._turn)

    @property
    def reads(self) -> Set[str]:
        """The types of messages that are read."""
        return self._handlers.keys()

    def streams(self, kinds: Set[MeasurementKind]) -> dict[str, float]:
        """Return the rates of the streams that are read, Hz, by message name. kinds: the
        measurements with which the vehicle is flown."""
        rates = {
            **dict.fromkeys(MOTION, MOTION_RATE if Odometry in kinds else IDLE_RATE_HZ),
            **dict.fromkeys(INERTIAL, INERTIAL_RATE if Imu in kinds else IDLE_RATE_HZ),
            "BATTERY_STATUS": 2.0, "RC_CHANNELS": 10.0, "GPS_RAW_INT": 5.0,
        }  # fmt: skip
        return {name: rate for name, rate in rates.items() if name in self._handlers}

    def handle(self, message: Message, now: Time) -> None:
        """Handle one message, after `ReceivedStatus` has handled it."""
        handle = self._handlers.get(message.get_type())
        measurement = None if handle is None else handle(message, now)
        if measurement is not None:
            self._taken.append(measurement)

    def add(self, measurement: Measurement) -> None:
        self._taken.append(measurement)

    def take(self) -> list[Measurement]:
        """Return the measurements since the last call, oldest first."""
        taken, self._taken = self._taken, []
        return taken

    def _attitude_quaternion(self, message: Message, now: Time) -> None:
        if not codec.is_attitude(message):
            self._attitude = None
            return
        self._attitude = self._turn = message
        if self._clock.to_boot(now) is None:
            self._time(message, now)

    def _local_position(self, message: Message, now: Time) -> Odometry | None:
        if self._clock.reboots != self._reboots:
            self._reboots = self._clock.reboots
            self._attitude = self._origin = self.odometry = self.spread = None
            self.anchor = self.anchor if self._is_outside else None
        self._has_flown = self._has_flown or self._status.armed
        attitude = self._attitude
        if attitude is None or now - self._status.at.get("ATTITUDE_QUATERNION", now) > MAX_AGE_NS:
            return None
        m = message
        if not codec.is_finite(m.x, m.y, m.z, m.vx, m.vy, m.vz):
            return None
        if self.anchor is None:
            self.anchor = self._standing(message)
        if self.anchor is None or self.spread is None:
            return None
        time = self._time(message, now)
        self.odometry = codec.odometry(
            message, attitude, time, spread=self.spread, anchor=self.anchor
        )
        return self.odometry

    def _time(self, message: Message, now: Time) -> Time:
        boot = boot_time(message)
        return now if boot is None else self._clock.to_run(boot, now)

    def _standing(self, message: Message) -> Anchor | None:
        """Return the anchor that puts the vehicle at the mission's start. Return None while the
        vehicle is not on the ground or has no valid position, and after a reboot if it has
        flown."""
        heading = self.heading
        if heading is None or self.spread is None or self._status.landed is not LandedState.GROUND:
            return None
        if self._has_flown and self._reboots:
            return None
        there = from_ned((message.x, message.y, message.z))
        return Anchor.joining(there, heading, self._context.start, self._context.heading)

    def _estimator_status(self, message: Message, now: Time) -> None:
        spread = self._spread_of(message)
        self.spread = spread if spread is not None and codec.is_finite(spread) else None
        if self.spread is None:
            self.odometry = None

    def _inertial_sample(self, message: Message, now: Time) -> Imu | None:
        m = message
        if not codec.is_finite(m.xacc, m.yacc, m.zacc, m.xgyro, m.ygyro, m.zgyro):
            return None
        rank = INERTIAL.index(message.get_type())
        if rank < self._inertial:
            return None
        if rank > self._inertial:
            self._inertial, self._imu = rank, None
        time = self._time(message, now)
        sample = codec.imu(message, time, self._imu)
        self._imu = time
        return sample

    def _global_origin(self, message: Message, now: Time) -> None:
        self._origin = codec.tangent(message)

    def _gps(self, message: Message, now: Time) -> Measurement | None:
        if self._origin is None or self.anchor is None:
            return None
        return codec.gps(message, now, origin=self._origin, anchor=self.anchor)


BATTERY_TIMEOUT_NS: Time = 5 * NS
"""SYS_STATUS is used only if BATTERY_STATUS has been silent for this long."""
LOW = mavlink.MAV_BATTERY_CHARGE_STATE_LOW
CRITICAL = mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
EMERGENCY = mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
FAILED = mavlink.MAV_BATTERY_CHARGE_STATE_FAILED
UNHEALTHY = mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY
STATES = MappingProxyType(
    {
        LOW: "low", CRITICAL: "critical", EMERGENCY: "nearly empty", FAILED: "failed",
        UNHEALTHY: "not well",
    }
)  # fmt: skip
"""The charge states that cause a warning, in words."""
WORDS = MappingProxyType(
    {"emergency": EMERGENCY, "dangerous": EMERGENCY, "critical": CRITICAL, "low": LOW}
)
"""The charge state that a word in a text about a battery stands for, the worst first."""
MONITOR = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY


class BatteryReports:
    """What one autopilot reports about its batteries. acts_at: the charge state from which on its
    failsafe acts, if enabled."""

    def __init__(self, status: ReceivedStatus, acts_at: int) -> None:
        self._status, self._acts_at = status, acts_at
        self._newest: Battery | None = None
        self._states: dict[int, int] = {}
        self._text: ReceivedText | None = None
        self._worst_text: tuple[int, str] = (0, "")

    def handle(self, message: Message, now: Time) -> Battery | None:
        """Return the battery after this message, or None if nothing has changed or nothing is
        known."""
        is_general = message.get_type() == "SYS_STATUS"
        if not is_general:
            self._states[message.id] = message.charge_state
        last = self._status.at.get("BATTERY_STATUS")
        is_better_known = is_general and last is not None and now - last < BATTERY_TIMEOUT_NS
        before = self._newest
        newest = (None if is_better_known else codec.battery(message, now)) or before
        if newest is None:
            return None
        self._newest = newest = newest._replace(warning=self._warning())
        return None if newest == before else newest

    def _warning(self) -> BatteryWarning | None:
        """Return the warning about a low battery, or None."""
        if not self._status.armed:
            self._worst_text = (0, "")
        for received in self._status.texts_after(self._text):
            self._text = received
            level = self._level(received.text.lower()) if self._status.armed else 0
            if level >= max(self._worst_text[0], LOW):
                self._worst_text = (level, received.text)
        level, text = self._worst_text
        reasons = [f"it says '{text}'"] if text else []
        states = self._states.values()
        worst = max((state for state in states if LOW <= state <= FAILED), default=0)
        sensors = self._status.sensors
        if not worst and (UNHEALTHY in states or (sensors and sensors.unhealthy & MONITOR)):
            worst = UNHEALTHY
        if worst:
            reasons.append(f"it reports its battery as {STATES[worst]}")
        if not reasons:
            return None
        acts = level >= self._acts_at or self._acts_at <= worst <= FAILED
        return BatteryWarning("; ".join(reasons), acts)

    def _level(self, words: str) -> int:
        """Return the charge state that a text reports, 0 if it reports none."""
        if "battery" not in words:
            return 0
        if "failsafe" in words and "clear" not in words:
            return self._acts_at
        return next((state for word, state in WORDS.items() if word in words), 0)
