"""The state of one autopilot on its port: its last messages, its parameters and its clock, and what
keeps the link to it alive.

The link is kept alive in the engine's tick: it sends heartbeats, requests streams, reads
parameters, compares clocks and repeats commands that were not acknowledged. It sends two
heartbeats: one of a ground station, without which PX4 sends no status texts, and one of an onboard
computer. After a reboot or a silence it makes all its requests again. A stream that the autopilot
sends by default, often, and that nobody reads is switched off, unless another program uses the same
connection. Closing the link restores the default rate of every stream; a program that is killed
leaves the rates as they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from typing import TYPE_CHECKING

from kybflow.core.signals import NS, MeasurementKind, Time
from kybflow.drivers.mavlink.control import others
from kybflow.drivers.mavlink.control.others import OtherCommanders
from kybflow.drivers.mavlink.control.requests import CommandRequests
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.telemetry import received_status
from kybflow.drivers.mavlink.telemetry import truth as ground_truth
from kybflow.drivers.mavlink.telemetry.battery import BatteryReports
from kybflow.drivers.mavlink.telemetry.clocks import BootClock, TimeSync
from kybflow.drivers.mavlink.telemetry.measurements import Telemetry
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
from kybflow.parts import Seat, StatusText

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

SHORTEST: Time = 3 * NS // 10
"""Shorter intervals without a message are no silence."""
FORGETS: Time = 2 * NS
"""After a longer silence the streams are requested again."""
REPEATED: Time = 60 * NS
"""How long a text that was reported is not reported again."""
DISARM, REFUSALS = "disarm", ("denied", "not landed", "refused", "rejected")
ALERT = mavlink.MAV_SEVERITY_ALERT
"""Texts as severe as this are reported at once, whatever they say."""
SEVERITIES = ("critical", "critical", "critical", "error", "warning")
ANSWERS = frozenset({"COMMAND_ACK", "PARAM_VALUE", "PARAM_ERROR", "TIMESYNC"})


class AutopilotState:
    """One autopilot. `status`, `telemetry`, `parameters`: what it reported. `requests`: commands
    to it. `sync`: the comparison of its clock with ours. `silence`: the newest interval without a
    message. `truth`: the ground truth of its simulator, None on hardware."""

    def __init__(
        self, seat: Seat, profile: FirmwareProfile, port: Port, truth: GroundTruth | None
    ) -> None:
        params, context = seat.params, seat.context
        self.port, self.profile, self.target = port, profile, (port.system, AUTOPILOT)
        self.is_outside = params.position == "outside"
        self.status, self.clock = ReceivedStatus(), BootClock()
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
        self._hears: dict[str, Callable[[Message, Time], None]] = {
            "COMMAND_ACK": self._answered,
            "PARAM_VALUE": self.parameters.hear,
            "PARAM_ERROR": self.parameters.hear,
            "TIMESYNC": self._compare_clocks,
            **dict.fromkeys(others.STREAMS, self._see_target),
            **dict.fromkeys(ground_truth.STREAMS, self._see_truth),
        }
        """Who takes in a message besides `status`; the rest is for `telemetry`."""
        self.silence: Silence | None = None
        self._alive: Time | None = None
        self._text: ReceivedText | None = None
        self._told: dict[str, Time] = {}
        self._kept: list[ReceivedText] = []
        port.want((*received_status.STREAMS, "STATUSTEXT"))
        port.want((*self.telemetry.reads, *ANSWERS, *others.STREAMS, *others.STEERING))
        if truth is not None:
            port.want(ground_truth.STREAMS)

    @property
    def ignored_because(self) -> str:
        """Why the autopilot may ignore our commands; empty where nothing is known."""
        if self.port.counts.signed:
            return "; what it sends is signed: give the driver its `key`"
        return ""

    def streams(self, kinds: Set[MeasurementKind]) -> dict[str, float]:
        """The messages that must come steadily, Hz. kinds: what the vehicle is flown by."""
        true = {} if self.truth is None else ground_truth.STREAMS
        return {
            **received_status.STREAMS,
            **others.STREAMS,
            **self.telemetry.streams(kinds),
            **true,
        }

    def age(self, now: Time) -> float:
        """Seconds since the last message; zero before the first."""
        return 0.0 if self._alive is None else (now - self._alive) / NS

    def listen(self, now: Time) -> bool:
        """Take in what arrived. Whether the autopilot was silent for so long before that it may
        have forgotten what it was asked for."""
        for message in self.port.take_overheard():
            self.others.overheard(message, now)
        messages = self.port.take()
        if not messages:
            return False
        gap = 0 if self._alive is None else now - self._alive
        self._alive = now
        if gap > SHORTEST:
            self.silence = Silence(now, gap / NS)
        for message in messages:
            self._hear(message, now)
        return gap > FORGETS

    def said(self, *, is_disarming: bool) -> Sequence[StatusText]:
        """The new texts of severity warning or worse, each at most once a minute. Refusals to
        disarm are held back while disarming is retried, and reported when the retries end."""
        fresh = self._fresh()
        if not fresh and not self._kept:
            return ()
        if is_disarming:
            self._kept += (text for text in fresh if _refuses_to_disarm(text))
            fresh = [text for text in fresh if not _refuses_to_disarm(text)]
        elif self._kept:
            fresh = [*(self._kept if self.status.armed else ()), *fresh]
            self._kept = []
        said = []
        for time, severity, text in fresh:
            told = self._told.get(text)
            if severity <= WARNING and (told is None or time - told > REPEATED):
                self._told[text] = time
                said.append(StatusText(SEVERITIES[severity], text))
        return said

    def _fresh(self) -> Sequence[ReceivedText]:
        """The texts since the last call, oldest first."""
        fresh = self.status.texts_after(self._text)
        if fresh:
            self._text = fresh[-1]
        return fresh

    def _hear(self, message: Message, now: Time) -> None:
        self.status.hear(message, now)
        self._hears.get(message.get_type(), self.telemetry.hear)(message, now)

    def _answered(self, message: Message, now: Time) -> None:
        self.others.answered(message, now)
        self.requests.hear(message, now)

    def _see_target(self, message: Message, now: Time) -> None:
        status, offboard = self.status, self.profile.modes["offboard"]
        if status.armed and status.landed is LandedState.AIR and status.mode == offboard:
            self.others.follows(message, now)
        else:
            self.others.follow_nobody()

    def _compare_clocks(self, message: Message, now: Time) -> None:
        for answer in self.sync.hear(message, now):
            self.port.send(answer)

    def _see_truth(self, message: Message, now: Time) -> None:
        if self.truth is not None:
            self.truth.hear(message, now, on_ground=self.status.landed is LandedState.GROUND)


def _refuses_to_disarm(text: ReceivedText) -> bool:
    words = text.text.lower()
    return text.severity > ALERT and DISARM in words and any(word in words for word in REFUSALS)


SET_MESSAGE_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
STATION = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""Our component id as a ground station."""
ROUND: Time = 5 * NS
"""Pause between two requests for streams that do not arrive."""
ROUNDS = 3
SILENT: Time = 3 * NS
SETTLED: Time = 2 * NS
"""How long after each request for streams the unread messages are counted."""
OFTEN = 4
"""Messages in that time: what comes more rarely and unread is left alone."""
POLL: Time = NS // 4
"""Pause between two requests for a message whose rate can't be set."""
STOPPED, USUAL = -1.0, 0.0
"""In place of an interval: never; as often as without a request."""


class StreamRequests:
    """Keeps the link to one autopilot alive.

    rates: the streams to request, Hz. names: the parameters to read.
    """

    def __init__(
        self, contact: AutopilotState, rates: Mapping[str, float], names: Sequence[str]
    ) -> None:
        self._port, self._status, self._clock = contact.port, contact.status, contact.clock
        self._target = contact.target
        self._requests, self._parameters = contact.requests, contact.parameters
        self._sync, self._rates, self._names = contact.sync, dict(rates), names
        self._fixed = contact.profile.polled
        self._polls = [_request(name, contact.target) for name in sorted(self._fixed)]
        self._poll: Time = 0
        self._heartbeat: Time = 0
        self._round: Time = 0
        self._rounds = 0
        self._reboots = 0
        self._asked: dict[int, None] = {}
        self._settled: Time | None = None

    def stream(self, name: str, rate: float, now: Time) -> None:
        """Request a stream at another rate, Hz."""
        is_other = rate != self._rates.get(name)
        self._rates[name] = rate
        if self._rounds and is_other:
            self._ask_for(name, now)

    def begin_anew(self) -> None:
        """Request everything again: the autopilot may have forgotten it."""
        self._round = self._rounds = 0

    def step(self, now: Time) -> None:
        """Send what is due, once a tick. Raises DriverError."""
        if now >= self._heartbeat:
            self._heartbeat = now + NS
            self._port.send(HEARTBEAT, STATION)
            self._port.send(heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER))
        if self._status.heartbeat is None:
            return
        if self._clock.reboots != self._reboots:
            self._reboots = self._clock.reboots
            self._status.at.pop("GPS_GLOBAL_ORIGIN", None)
            self._parameters.read(self._names, now, again=True)
            self.begin_anew()
        if self._rounds < ROUNDS and now >= self._round:
            self._ask(now)
        if self._settled is not None and now >= self._settled:
            self._stop_unread(now)
        if now >= self._poll:
            self._poll = now + POLL
            for message in self._polls:
                self._port.send(message)
        for due in (self._requests, self._parameters, self._sync):
            for message in due.due(now):
                self._port.send(message)

    def _ask(self, now: Time) -> None:
        if self._rounds == 0:
            self._parameters.read(self._names, now)
        self._rounds += 1
        self._round = now + ROUND
        self._settled = now + SETTLED
        self._port.unread()
        for name in self._rates:
            if self._rounds == 1 or now - self._status.at.get(name, -SILENT) >= SILENT:
                self._ask_for(name, now)
        if "GPS_GLOBAL_ORIGIN" not in self._status.at:
            number = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
            self._requests.ask(mavlink.MAV_CMD_REQUEST_MESSAGE, number, now=now, attempts=2)

    def close(self) -> None:
        """Let the autopilot send every stream again as often as without a request of ours."""
        for number in self._asked:
            params = (SET_MESSAGE_INTERVAL, 0, number, USUAL, 0.0, 0.0, 0.0, 0.0, 0.0)
            self._port.send(mavlink.MAVLink_command_long_message(*self._target, *params))

    def _stop_unread(self, now: Time) -> None:
        """Switch off what came often since streams were requested, and nobody read."""
        self._settled = None
        often = (number for number, count in self._port.unread().items() if count >= OFTEN)
        for number in sorted(often):
            self._ask_every(STOPPED, number, now)

    def _ask_for(self, name: str, now: Time) -> None:
        if name in self._fixed:
            return
        number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        self._ask_every(round(1e6 / self._rates[name]), number, now)

    def _ask_every(self, interval: float, number: int, now: Time) -> None:
        """Request a message by its number every `interval` microseconds."""
        self._asked[number] = None
        self._requests.ask(SET_MESSAGE_INTERVAL, number, interval, now=now, attempts=3)


def _request(name: str, target: tuple[int, int]) -> Message:
    """The request for one message of this name."""
    number = float(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))
    params = (mavlink.MAV_CMD_REQUEST_MESSAGE, 0, number, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAVLink_command_long_message(*target, *params)
