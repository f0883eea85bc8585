"""The newest status that an autopilot reported: its mode, whether it is armed, the health of its
sensors, its texts.

A STATUSTEXT longer than one message arrives in chunks of 50 bytes that share an id; a lost chunk is
replaced by an ellipsis. Only HEARTBEATs from an autopilot count: a camera or a ground station may
have the same system id. PX4 sends no text if it is merely not ready to arm; only the health of its
sensors shows why."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from itertools import takewhile
from math import isfinite
from types import MappingProxyType
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink

WARNING, NOTICE = mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_NOTICE
"""Severities; a lower number is more severe."""
NO_AUTOPILOT = mavlink.MAV_AUTOPILOT_INVALID
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
READY = mavlink.MAV_SYS_STATUS_PREARM_CHECK
TEXT_CHUNK = 50
CHUNK_TIMEOUT: Time = NS // 5
"""How long a text waits for its missing chunks."""
STREAMS = MappingProxyType(
    {
        "HEARTBEAT": 5.0, "CURRENT_MODE": 5.0, "SYS_STATUS": 5.0, "EXTENDED_SYS_STATE": 10.0,
        "EKF_STATUS_REPORT": 5.0, "ESTIMATOR_STATUS": 5.0,
    }
)  # fmt: skip
"""The streams that are read, Hz. A mode set by a pilot or a failsafe, and a landing, must be
noticed within 0.2 s."""
MOST_TEXTS = 100
MOST_CHUNKS = 20
LOST = "…"


class LandedState(Enum):
    """The values of MAV_LANDED_STATE."""

    UNKNOWN = 0
    GROUND = 1
    AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class ReceivedText(NamedTuple):
    """A text of the autopilot. time: when it arrived. severity: its MAV_SEVERITY, from 0 (worst) to
    7."""

    time: Time
    severity: int
    text: str


class Silence(NamedTuple):
    """An interval without a message. ended: when it ended. seconds: its length."""

    ended: Time
    seconds: float


class InnovationRatios(NamedTuple):
    """The innovations of an autopilot's filter, each divided by the largest that it accepts.

    Both firmwares report these ratios, PX4 in ESTIMATOR_STATUS, ArduPilot as the "variances" of
    EKF_STATUS_REPORT (`AP_NavEKF3::getVariances`). Normally they are below 0.5; above 1 the filter
    has rejected a measurement (MAVLink, `ESTIMATOR_STATUS`). What is not measured counts as 0."""

    position: float
    height: float
    velocity: float
    heading: float

    def __str__(self) -> str:
        found = (f"{name} {value:.2f}" for name, value in zip(self._fields, self, strict=True))
        return ", ".join(found)


class _Chunks:
    """A text whose chunks have not all arrived. `last`: the index of its last chunk, None while
    unknown."""

    def __init__(self, since: Time, severity: int) -> None:
        self.since, self.severity = since, severity
        self.parts: dict[int, str] = {}
        self.last: int | None = None

    @property
    def is_whole(self) -> bool:
        return self.last is not None and all(i in self.parts for i in range(self.last + 1))

    @property
    def text(self) -> str:
        """The text so far, with an ellipsis for every gap."""
        last = max(self.parts) + 1 if self.last is None else self.last
        words = [self.parts.get(i, LOST) for i in range(last + 1)]
        return "".join(w for i, w in enumerate(words) if w != LOST or words[i - 1 : i] != [LOST])


class ReceivedStatus:
    """The newest status of one autopilot. A field is None until it is reported.

    heartbeat: when the newest HEARTBEAT arrived.
    autopilot: its MAV_AUTOPILOT.
    status: its MAV_STATE.
    mode: its custom_mode.
    ready: whether it can be armed in its current mode.
    ekf: the flags of its estimator (EKF_STATUS_REPORT or ESTIMATOR_STATUS).
    innovations: how well the measurements fit that estimator, from the same message.
    rejected_for: the time from the first to the newest report in a row by which the estimator
    rejects a measurement, ns; zero if it accepts them.
    servos: the pulses of its main outputs in microseconds, channel 1 first.
    throttle: the throttle that its attitude controller commands, 0 to 1.
    at: when each type of message last arrived.
    texts: its texts, the newest last.
    """

    def __init__(self) -> None:
        self.heartbeat: Time | None = None
        self.autopilot: int | None = None
        self.status: int | None = None
        self.mode: int | None = None
        self.armed = False
        self.ready: bool | None = None
        self.sensors: SensorHealth | None = None
        self.landed = LandedState.UNKNOWN
        self.ekf: int | None = None
        self.innovations: InnovationRatios | None = None
        self.rejected_for: Time = 0
        self._rejecting: Time | None = None
        self.servos: tuple[int, ...] = ()
        self.throttle: float | None = None
        self.at: dict[str, Time] = {}
        self.texts: deque[ReceivedText] = deque(maxlen=MOST_TEXTS)
        self._chunks: dict[tuple[int, int], _Chunks] = {}
        self._handlers: dict[str, Callable[[Message, Time], None]] = {
            "HEARTBEAT": self._heartbeat,
            "CURRENT_MODE": self._current_mode,
            "SYS_STATUS": self._sys_status,
            "EXTENDED_SYS_STATE": self._extended_sys_state,
            "EKF_STATUS_REPORT": self._ekf_status_report,
            "ESTIMATOR_STATUS": self._estimator_status,
            "SERVO_OUTPUT_RAW": self._servo_output_raw,
            "ATTITUDE_TARGET": self._attitude_target,
            "STATUSTEXT": self._statustext,
        }

    def handle(self, message: Message, now: Time) -> None:
        """Handle one message. Messages must be passed in the order of arrival."""
        kind = message.get_type()
        handle = self._handlers.get(kind)
        if handle is not None:
            handle(message, now)
        self.at[kind] = now
        if self._chunks:
            waited = [k for k, c in self._chunks.items() if now - c.since > CHUNK_TIMEOUT]
            for key in waited:
                self._end(key)

    @property
    def unhealthy(self) -> str:
        """A description of the unhealthy sensors; empty if there are none."""
        sensors = "" if self.sensors is None else self.sensors.words
        return f"it reports as not well: {sensors}" if sensors else ""

    def texts_after(self, text: ReceivedText | None) -> Sequence[ReceivedText]:
        """Return the texts after this one, oldest first; all texts if it is None."""
        if not self.texts or self.texts[-1] is text:
            return ()
        return list(takewhile(lambda other: other is not text, reversed(self.texts)))[::-1]

    def words(self, since: Time, severity: int = WARNING) -> str:
        """Join the texts that arrived at `since` or later and have this severity or worse, oldest
        first, each once."""
        texts = (s.text for s in self.texts if s.time >= since and s.severity <= severity)
        newest = dict.fromkeys(reversed(list(texts)))
        return "; ".join(reversed(newest))

    def _heartbeat(self, message: Message, now: Time) -> None:
        if message.autopilot == NO_AUTOPILOT:
            return
        self.heartbeat = now
        self.autopilot = message.autopilot
        self.status = message.system_status
        self.mode = message.custom_mode
        self.armed = bool(message.base_mode & ARMED)

    def _current_mode(self, message: Message, now: Time) -> None:
        self.mode = message.custom_mode

    def _sys_status(self, message: Message, now: Time) -> None:
        m = message
        self.sensors = SensorHealth(
            m.onboard_control_sensors_present,
            m.onboard_control_sensors_enabled,
            m.onboard_control_sensors_health,
        )
        self.ready = bool(m.onboard_control_sensors_health & READY)

    def _extended_sys_state(self, message: Message, now: Time) -> None:
        try:
            self.landed = LandedState(message.landed_state)
        except ValueError:
            self.landed = LandedState.UNKNOWN

    def _ekf_status_report(self, message: Message, now: Time) -> None:
        m = message
        ratios = m.pos_horiz_variance, m.pos_vert_variance, m.velocity_variance, m.compass_variance
        self._estimate(m.flags, ratios, now)

    def _estimator_status(self, message: Message, now: Time) -> None:
        m = message
        ratios = m.pos_horiz_ratio, m.pos_vert_ratio, m.vel_ratio, m.mag_ratio
        self._estimate(m.flags, ratios, now)

    def _estimate(self, flags: int, ratios: Iterable[float], now: Time) -> None:
        self.ekf = flags
        found = InnovationRatios(*(ratio if isfinite(ratio) else 0.0 for ratio in ratios))
        self.innovations = found
        if max(found) <= 1.0:
            self._rejecting = None
        elif self._rejecting is None:
            self._rejecting = now
        self.rejected_for = 0 if self._rejecting is None else now - self._rejecting

    def _servo_output_raw(self, message: Message, now: Time) -> None:
        if message.port == 0:
            self.servos = tuple(getattr(message, f"servo{i}_raw") for i in range(1, 17))

    def _attitude_target(self, message: Message, now: Time) -> None:
        self.throttle = message.thrust if isfinite(message.thrust) else None

    def _statustext(self, message: Message, now: Time) -> None:
        text: str = message.text.split("\0", maxsplit=1)[0]
        if message.id == 0:
            self._add(now, message.severity, text)
            return
        key = message.get_srcComponent(), message.id
        if key not in self._chunks:
            if len(self._chunks) >= MOST_CHUNKS:
                self._end(next(iter(self._chunks)))
            self._chunks[key] = _Chunks(now, message.severity)
        chunks = self._chunks[key]
        chunks.parts[message.chunk_seq] = text
        if len(text) < TEXT_CHUNK:
            chunks.last = max(message.chunk_seq, chunks.last or 0)
        if chunks.is_whole:
            self._end(key)

    def _end(self, key: tuple[int, int]) -> None:
        chunks = self._chunks.pop(key)
        self._add(chunks.since, chunks.severity, chunks.text)

    def _add(self, time: Time, severity: int, text: str) -> None:
        printable = (character if character.isprintable() else " " for character in text)
        clean = " ".join("".join(printable).split())
        if clean:
            self.texts.append(ReceivedText(time, severity, clean))


SENSORS = MappingProxyType(
    {
        1 << bit: name
        for bit, name in enumerate(
            (
                "gyroscope", "accelerometer", "compass", "barometer", "airspeed sensor",
                "GPS receiver", "optical flow", "position from outside", "range finder",
                "ground truth from outside", "control of turn rates", "control of attitude",
                "control of heading", "control of height", "control of position", "motors",
                "receiver of the transmitter", "second gyroscope", "second accelerometer",
                "second compass", "fence", "estimate of attitude and position", "terrain data",
                "reversed motors", "log", "battery", "proximity sensor", "satellite link", "",
                "obstacle avoidance", "propulsion",
            )
        )
        if name
    }
)  # fmt: skip
"""The bits of MAV_SYS_STATUS_SENSOR. Bit 28 is the readiness to arm; bit 31 announces more bits."""
WAYS_OUT = MappingProxyType(
    {
        mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION: "does it receive poses, and is it set up"
        " to use them?",
        mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER: "is the transmitter on?",
        mavlink.MAV_SYS_STATUS_LOGGING: "is its memory card missing, or full?",
        mavlink.MAV_SYS_STATUS_SENSOR_BATTERY: "is it charged, and its monitor set up?",
    }
)


class SensorHealth(NamedTuple):
    """The sensors in SYS_STATUS, one bit each (MAV_SYS_STATUS_SENSOR)."""

    present: int
    enabled: int
    health: int

    @property
    def unhealthy(self) -> int:
        """The sensors that are present, enabled and not healthy."""
        return self.present & self.enabled & ~self.health

    @property
    def words(self) -> str:
        """The names of the unhealthy sensors, with advice if there is any; empty if all are
        healthy."""
        return ", ".join(
            name + (f" ({WAYS_OUT[bit]})" if bit in WAYS_OUT else "")
            for bit, name in SENSORS.items()
            if bit & self.unhealthy
        )
