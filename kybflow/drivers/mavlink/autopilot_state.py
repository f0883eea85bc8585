"""The state of one autopilot on its port, and the keep-alive and the capacity of the link to it.

`AutopilotState` handles each message of the autopilot: its status, measurements, parameters and
clock. `KeepAlive` sends heartbeats, requests streams, reads parameters, compares clocks and repeats
unacknowledged commands.

Two heartbeats are sent: one as a ground station, without which PX4 sends no status texts, and one
as an onboard computer. After a reboot or a long silence all requests are repeated. A stream that
the autopilot sends often by default and that no module reads is switched off, unless another
program uses the same connection. Closing the link restores the default rate of every stream; a
program that is killed leaves the rates as they are.

A serial line of B baud carries B / 10 bytes a second each way. The autopilot's streams get half of
that (`LineCapacity`): they are all slowed by the same factor, but not below once a second. The
other half is for parameters, replies and texts, and for radios that send in only one direction at a
time. Setpoints and poses are not slowed; if they don't fit, the preflight check of the line fails.
Other kinds of connection count as fast enough."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set

from kybflow.core.signals import NS, MeasurementKind, Time
from kybflow.drivers.mavlink.control import others
from kybflow.drivers.mavlink.control.others import OtherCommanders
from kybflow.drivers.mavlink.control.requests import CommandRequests
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.params import MavlinkParams
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.framing import LAYOUTS, NUMBERS, Message, mavlink
from kybflow.drivers.mavlink.protocol.signing import SIGNATURE_BYTES
from kybflow.drivers.mavlink.telemetry import received_status
from kybflow.drivers.mavlink.telemetry import truth as ground_truth
from kybflow.drivers.mavlink.telemetry.clocks import SIMULATOR_BUCKET, BootClock, TimeSync
from kybflow.drivers.mavlink.telemetry.measurements import BatteryReports, Telemetry
from kybflow.drivers.mavlink.telemetry.parameters import AutopilotParameters
from kybflow.drivers.mavlink.telemetry.received_status import (
    WARNING,
    LandedState,
    ReceivedStatus,
    ReceivedText,
    Silence,
)
from kybflow.drivers.mavlink.telemetry.truth import GroundTruth
from kybflow.drivers.mavlink.transport.router import AUTOPILOT, HEARTBEAT, Port, heartbeat
from kybflow.drivers.mavlink.transport.wire import read_address
from kybflow.parts import Check, Seat, StatusText

SILENCE_THRESHOLD_NS: Time = 3 * NS // 10
"""The longest interval without a message that doesn't count as a silence."""
STREAM_LOSS_TIMEOUT_NS: Time = 2 * NS
"""The streams are requested again after a silence longer than this."""
TEXT_REPEAT_NS: Time = 60 * NS
"""How long a status text is suppressed after it was reported."""
DISARM, REFUSALS = "disarm", ("denied", "not landed", "refused", "rejected")
ALERT = mavlink.MAV_SEVERITY_ALERT
"""A text of this severity or worse is never held back as a refusal to disarm."""
SEVERITIES = ("critical", "critical", "critical", "error", "warning")
ANSWERS = frozenset({"COMMAND_ACK", "PARAM_VALUE", "PARAM_ERROR", "TIMESYNC"})


class AutopilotState:
    """The state of one autopilot.

    status, telemetry, parameters: what the autopilot reported.
    requests: the commands sent to it.
    sync: the comparison of its clock with ours.
    silence: the most recent interval without a message.
    truth: the ground truth of its simulator, None on hardware."""

    def __init__(
        self, seat: Seat, profile: FirmwareProfile, port: Port, truth: GroundTruth | None
    ) -> None:
        params, context = seat.params, seat.context
        self.port, self.profile, self.target = port, profile, (port.system, AUTOPILOT)
        self.is_outside = params.position == "outside"
        self.status = ReceivedStatus()
        self.clock = BootClock() if truth is None else BootClock(SIMULATOR_BUCKET)
        self.sync = TimeSync(self.clock)
        self.requests = CommandRequests(
            self.status, target=self.target, own_system=params.own_system
        )
        self.parameters = AutopilotParameters(
            profile.integer_parameters_bytewise, target=self.target, renamed=profile.renamed
        )
        self.telemetry = Telemetry(
            context, profile.spread, profile.streams,
            BatteryReports(self.status, profile.battery_acts_at), self.status, self.clock,
            self.is_outside,
        )  # fmt: skip
        self.others = OtherCommanders(port.system, params.own_system)
        self.truth = truth
        self.silence: Silence | None = None
        self._handlers: dict[str, Callable[[Message, Time], None]] = {
            "COMMAND_ACK": self._handle_acknowledgement,
            "PARAM_VALUE": self.parameters.handle,
            "PARAM_ERROR": self.parameters.handle,
            "TIMESYNC": self._compare_clocks,
            **dict.fromkeys(others.STREAMS, self._handle_target),
            **dict.fromkeys(ground_truth.STREAMS, self._handle_truth),
        }
        """Handlers by message type, called after `status`; `telemetry` handles all other types."""
        self._received_at: Time | None = None
        self._text: ReceivedText | None = None
        self._reported: dict[str, Time] = {}
        self._held_back: list[ReceivedText] = []
        port.want((*received_status.STREAMS, "STATUSTEXT"))
        port.want((*self.telemetry.reads, *ANSWERS, *others.STREAMS, *others.STEERING))
        if truth is not None:
            port.want(ground_truth.STREAMS)

    @property
    def ignored_because(self) -> str:
        """Why the autopilot may be ignoring our commands; empty if no reason is known."""
        if self.port.counts.signed:
            return "; what it sends is signed: give the driver its `key`"
        return ""

    def streams(self, kinds: Set[MeasurementKind]) -> dict[str, float]:
        """Return the rates of the streams that are read, Hz, by message name. kinds: the
        measurements with which the vehicle is flown."""
        true = {} if self.truth is None else ground_truth.STREAMS
        return {
            **received_status.STREAMS,
            **others.STREAMS,
            **self.telemetry.streams(kinds),
            **true,
        }

    def age(self, now: Time) -> float:
        """Return the seconds since the last message of any type; zero before the first. (The age of
        the link in the runtime counts measurements only.)"""
        return 0.0 if self._received_at is None else (now - self._received_at) / NS

    def receive(self, now: Time) -> bool:
        """Handle the messages that arrived. Return whether the silence before them was so long that
        the autopilot may have forgotten our requests."""
        for message in self.port.take_overheard():
            self.others.overheard(message, now)
        messages = self.port.take()
        if not messages:
            return False
        gap = 0 if self._received_at is None else now - self._received_at
        self._received_at = now
        if gap > SILENCE_THRESHOLD_NS:
            self.silence = Silence(now, gap / NS)
        for message in messages:
            self.status.handle(message, now)
            self._handlers.get(message.get_type(), self.telemetry.handle)(message, now)
        return gap > STREAM_LOSS_TIMEOUT_NS

    def new_texts(self, *, is_disarming: bool) -> Sequence[StatusText]:
        """Return the new texts of severity warning or worse, each at most once a minute. Refusals
        to disarm are held back while disarming is retried, and reported afterwards if the vehicle
        is still armed."""
        texts = self.status.texts_after(self._text)
        if texts:
            self._text = texts[-1]
        elif not self._held_back:
            return ()
        if is_disarming:
            self._held_back += (text for text in texts if _refuses_to_disarm(text))
            texts = [text for text in texts if not _refuses_to_disarm(text)]
        elif self._held_back:
            texts = [*(self._held_back if self.status.armed else ()), *texts]
            self._held_back = []
        reported = []
        for time, severity, text in texts:
            last = self._reported.get(text)
            if severity <= WARNING and (last is None or time - last > TEXT_REPEAT_NS):
                self._reported[text] = time
                reported.append(StatusText(SEVERITIES[severity], text))
        return reported

    def _handle_acknowledgement(self, message: Message, now: Time) -> None:
        self.others.answered(message, now)
        self.requests.handle(message, now)

    def _handle_target(self, message: Message, now: Time) -> None:
        status, offboard = self.status, self.profile.modes["offboard"]
        if status.armed and status.landed is LandedState.AIR and status.mode == offboard:
            self.others.follows(message, now)
        else:
            self.others.follow_nobody()

    def _compare_clocks(self, message: Message, now: Time) -> None:
        for answer in self.sync.handle(message, now):
            self.port.send(answer)

    def _handle_truth(self, message: Message, now: Time) -> None:
        if self.truth is not None:
            self.truth.handle(message, now, on_ground=self.status.landed is LandedState.GROUND)


def _refuses_to_disarm(text: ReceivedText) -> bool:
    words = text.text.lower()
    return text.severity > ALERT and DISARM in words and any(word in words for word in REFUSALS)


SET_MESSAGE_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST_MESSAGE = mavlink.MAV_CMD_REQUEST_MESSAGE
STATION = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""Our component id in ground-station messages."""
ROUND_PERIOD_NS: Time = 5 * NS
"""The pause between two rounds of requests for streams that don't arrive."""
MOST_ROUNDS = 3
STREAM_GAP_NS: Time = 3 * NS
COUNTING_TIME_NS: Time = 2 * NS
"""How long unread messages are counted after each round of stream requests."""
UNREAD_MESSAGES = 4
"""A stream with at least this many unread messages in that time is switched off."""
POLL_PERIOD_NS: Time = NS // 4
"""The pause between two requests for a message whose rate can't be set."""
STREAM_STOPPED, STREAM_DEFAULT = -1.0, 0.0
"""Special values of SET_MESSAGE_INTERVAL: stop the stream; restore its default rate."""


class KeepAlive:
    """Keeps the link to one autopilot alive. rates: the streams to request, Hz by name. names: the
    parameters to read."""

    def __init__(
        self, autopilot: AutopilotState, rates: Mapping[str, float], names: Sequence[str]
    ) -> None:
        self._autopilot, self._rates, self._names = autopilot, dict(rates), names
        self._polled = [
            codec.command_long(autopilot.target, REQUEST_MESSAGE, NUMBERS[name])
            for name in sorted(autopilot.profile.polled)
        ]
        self._poll: Time = 0
        self._heartbeat: Time = 0
        self._round: Time = 0
        self._rounds = 0
        self._reboots = 0
        self._requested: dict[int, None] = {}
        self._settled: Time | None = None

    def stream(self, name: str, rate: float, now: Time) -> None:
        """Set the rate of a stream, Hz, and request it again if the rate has changed."""
        is_other = rate != self._rates.get(name)
        self._rates[name] = rate
        if self._rounds and is_other:
            self._request_stream(name, now)

    def begin_anew(self) -> None:
        """Repeat all requests, because the autopilot may have forgotten them."""
        self._round = self._rounds = 0

    def step(self, now: Time) -> None:
        """Send the messages that are due. Raises DriverError."""
        a = self._autopilot
        if now >= self._heartbeat:
            self._heartbeat = now + NS
            a.port.send(HEARTBEAT, STATION)
            a.port.send(heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER))
        if a.status.heartbeat is None:
            return
        if a.clock.reboots != self._reboots:
            self._reboots = a.clock.reboots
            a.status.at.pop("GPS_GLOBAL_ORIGIN", None)
            a.parameters.read(self._names, now, again=True)
            self.begin_anew()
        if self._rounds < MOST_ROUNDS and now >= self._round:
            self._request_all(now)
        if self._settled is not None and now >= self._settled:
            self._settled = None
            self._stop_unread(now)
        if now >= self._poll:
            self._poll = now + POLL_PERIOD_NS
            for message in self._polled:
                a.port.send(message)
        for requests in (a.requests, a.parameters, a.sync):
            for message in requests.due(now):
                a.port.send(message)

    def close(self) -> None:
        """Restore the default rate of every stream that was requested."""
        a = self._autopilot
        for number in self._requested:
            a.port.send(codec.command_long(a.target, SET_MESSAGE_INTERVAL, number, STREAM_DEFAULT))

    def _stop_unread(self, now: Time) -> None:
        """Switch off the streams that arrived often since the last requests and were not read."""
        unread = self._autopilot.port.unread()
        for number in sorted(n for n, count in unread.items() if count >= UNREAD_MESSAGES):
            self._set_interval(STREAM_STOPPED, number, now)

    def _request_all(self, now: Time) -> None:
        a = self._autopilot
        if self._rounds == 0:
            a.parameters.read(self._names, now)
        self._rounds += 1
        self._round, self._settled = now + ROUND_PERIOD_NS, now + COUNTING_TIME_NS
        a.port.unread()
        for name in self._rates:
            if self._rounds == 1 or now - a.status.at.get(name, -STREAM_GAP_NS) >= STREAM_GAP_NS:
                self._request_stream(name, now)
        if "GPS_GLOBAL_ORIGIN" not in a.status.at:
            number = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
            a.requests.ask(REQUEST_MESSAGE, number, now=now, attempts=2)

    def _request_stream(self, name: str, now: Time) -> None:
        if name not in self._autopilot.profile.polled:
            self._set_interval(round(1e6 / self._rates[name]), NUMBERS[name], now)

    def _set_interval(self, interval: float, number: int, now: Time) -> None:
        """Request a message, given by its id, every `interval` microseconds."""
        self._requested[number] = None
        self._autopilot.requests.ask(SET_MESSAGE_INTERVAL, number, interval, now=now, attempts=3)


BITS_PER_BYTE = 10
FRAME_OVERHEAD = 12
"""The bytes of a frame apart from its fields and its signature."""
STREAMS_SHARE, SENT_SHARE = 0.5, 0.8
"""The fraction of a line's capacity for the streams, and the largest fraction that our messages may
take."""
MIN_HZ = 1.0
"""The rate, Hz, below which streams are not slowed."""


class LineCapacity:
    """The serial line to one vehicle. line: its capacity each way, bytes per second; None for
    connections that are fast enough. params: the driver's parameters in the mission."""

    def __init__(self, params: MavlinkParams) -> None:
        place = None if params.address is None else read_address(params.address)
        is_serial = place is not None and place.kind == "serial"
        self.line = place.number / BITS_PER_BYTE if place is not None and is_serial else None
        self._params = params
        self._head = FRAME_OVERHEAD + (0 if params.key is None else SIGNATURE_BYTES)

    def fitting(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Return these stream rates, Hz, reduced to the line's capacity."""
        if self.line is None:
            return dict(rates)
        factor = min(1.0, STREAMS_SHARE * self.line / self._load(rates))
        return {name: min(rate, max(factor * rate, MIN_HZ)) for name, rate in rates.items()}

    def check(self) -> list[Check]:
        """Return the preflight check of the serial line's data rate; none without a serial line."""
        if self.line is None:
            return []
        params = self._params
        sent, way_out = {"SET_POSITION_TARGET_LOCAL_NED": params.rate}, "a lower `rate`"
        if params.position == "outside":
            sent["ODOMETRY"], way_out = params.vision_rate, "a lower `rate` and `vision_rate`"
        load = self._load(sent)
        found = f"{load:.0f} bytes a second are sent to it, the line carries {self.line:.0f}"
        if load <= SENT_SHARE * self.line:
            return [Check("serial line", True, found)]
        way_out = f"set {way_out}, or a higher baud rate on both sides"
        return [Check("serial line", False, f"{found}: {way_out}", waits=False)]

    def _load(self, rates: Mapping[str, float]) -> float:
        """Return the load of these streams, bytes per second."""
        sizes = {name: int(LAYOUTS[NUMBERS[name]].size) for name in rates if name in NUMBERS}
        return sum(rates[name] * (self._head + size) for name, size in sizes.items())
