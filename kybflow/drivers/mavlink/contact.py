"""One autopilot on its port: what it last reported, its parameters and clock, and the upkeep of the
link to it.

Upkeep means heartbeats, streams that are asked for, parameters that are read, clocks that are
compared, commands that are sent again. All of it happens in the engine's tick and stops with it.
Two heartbeats are sent: a ground station's, without which PX4 sends no texts, and an onboard
computer's. What an autopilot may have forgotten, because it rebooted or was not heard for a while,
is asked for again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.control.requests import CommandRequests
from kybflow.drivers.mavlink.firmware import FirmwareProfile
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
TRUE = frozenset({"SIM_STATE", "HIL_STATE_QUATERNION"})
ANSWERS = frozenset({"COMMAND_ACK", "PARAM_VALUE", "PARAM_ERROR", "TIMESYNC"})


class Contact:
    """One autopilot. `status`, `telemetry`, `parameters`: what it reported. `requests`: commands
    to it. `sync`: the comparison of its clock with ours. `silence`: the newest interval without a
    message. `truth`: the ground truth of its simulator, None on hardware."""

    def __init__(self, seat: Seat, profile: FirmwareProfile, port: Port) -> None:
        params, context = seat.params, seat.context
        self.port, self.profile, self.target = port, profile, (port.system, AUTOPILOT)
        self.is_outside = params.position == "outside"
        self.status, self.clock = ReceivedStatus(), BootClock()
        self.sync = TimeSync(self.clock)
        self.requests = CommandRequests(
            self.status, target=self.target, own_system=params.own_system
        )
        self.parameters = AutopilotParameters(
            profile.integer_parameters_bytewise, target=self.target
        )
        self.telemetry = Telemetry(
            context, profile.spread, profile.streams.keys(), self.status, self.clock,
            self.is_outside,
        )  # fmt: skip
        self.truth = GroundTruth(context, profile.sphere) if params.simulator else None
        self.silence: Silence | None = None
        self._alive: Time | None = None
        self._text: ReceivedText | None = None
        self._told: dict[str, Time] = {}
        self._kept: list[ReceivedText] = []
        port.want({*self.status.reads, *self.telemetry.reads, *profile.streams, *ANSWERS})
        if self.truth is not None:
            port.want(TRUE)

    @property
    def ignored_because(self) -> str:
        """Why the autopilot may ignore our commands; empty where nothing is known."""
        if self.port.counts.signed:
            return "; what it sends is signed: give the driver its `key`"
        return ""

    def age(self, now: Time) -> float:
        """Seconds since the last message; zero before the first."""
        return 0.0 if self._alive is None else (now - self._alive) / NS

    def listen(self, now: Time) -> bool:
        """Take in what arrived. Whether the autopilot was silent for so long before that it may
        have forgotten what it was asked for."""
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

    def _fresh(self) -> list[ReceivedText]:
        """The texts since the last call, oldest first."""
        texts = self.status.texts
        if not texts or texts[-1] is self._text:
            return []
        fresh = list(takewhile(lambda text: text is not self._text, reversed(texts)))
        self._text = texts[-1]
        return fresh[::-1]

    def _hear(self, message: Message, now: Time) -> None:
        sort = message.get_type()
        self.status.hear(message, now)
        if sort == "COMMAND_ACK":
            self.requests.hear(message, now)
        elif sort in {"PARAM_VALUE", "PARAM_ERROR"}:
            self.parameters.hear(message, now)
        elif sort == "TIMESYNC":
            for answer in self.sync.hear(message, now):
                self.port.send(answer)
        elif sort in TRUE:
            if self.truth is not None:
                self.truth.hear(message, now, on_ground=self.status.landed is LandedState.GROUND)
        else:
            self.telemetry.hear(message, now)


def _refuses_to_disarm(text: ReceivedText) -> bool:
    words = text.text.lower()
    return text.severity > ALERT and DISARM in words and any(word in words for word in REFUSALS)


STATION = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""Our component id as a ground station."""
ROUND: Time = 5 * NS
"""Pause between two requests for streams that do not arrive."""
ROUNDS = 3
SILENT: Time = 3 * NS


class Upkeep:
    """Keeps the link to one autopilot alive.

    rates: the streams to request, Hz. names: the parameters to read.
    """

    def __init__(self, contact: Contact, rates: Mapping[str, float], names: Sequence[str]) -> None:
        self._port, self._status, self._clock = contact.port, contact.status, contact.clock
        self._requests, self._parameters = contact.requests, contact.parameters
        self._sync, self._rates, self._names = contact.sync, dict(rates), names
        self._heartbeat: Time = 0
        self._round: Time = 0
        self._rounds = 0
        self._reboots = 0

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
        for due in (self._requests, self._parameters, self._sync):
            for message in due.due(now):
                self._port.send(message)

    def _ask(self, now: Time) -> None:
        if self._rounds == 0:
            self._parameters.read(self._names, now)
        self._rounds += 1
        self._round = now + ROUND
        for name in self._rates:
            if self._rounds == 1 or now - self._status.at.get(name, -SILENT) >= SILENT:
                self._ask_for(name, now)
        if "GPS_GLOBAL_ORIGIN" not in self._status.at:
            number = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
            self._requests.ask(mavlink.MAV_CMD_REQUEST_MESSAGE, number, now=now, attempts=2)

    def _ask_for(self, name: str, now: Time) -> None:
        number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        interval = round(1e6 / self._rates[name])
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self._requests.ask(command, number, interval, now=now, attempts=3)
