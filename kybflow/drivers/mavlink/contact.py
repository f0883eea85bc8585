"""What is known of one autopilot, and how it is heard: everything that it says goes from here to
whom it concerns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.control.override import Silence
from kybflow.drivers.mavlink.control.requests import Requests
from kybflow.drivers.mavlink.firmware.profile import Profile
from kybflow.drivers.mavlink.telemetry.clocks import BootClock
from kybflow.drivers.mavlink.telemetry.heard import WARNING, Heard, Landed
from kybflow.drivers.mavlink.telemetry.heard import Said as Text
from kybflow.drivers.mavlink.telemetry.measurements import Telemetry
from kybflow.drivers.mavlink.telemetry.parameters import Parameters
from kybflow.drivers.mavlink.telemetry.truth import GroundTruth
from kybflow.drivers.mavlink.transport.router import Port
from kybflow.drivers.mavlink.upkeep import Chores
from kybflow.parts import Said, Seat

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

AUTOPILOT = 1
"""Its component."""
SHORTEST: Time = 3 * NS // 10
"""A silence that is told."""
FORGETS: Time = 2 * NS
"""A silence after which its streams are asked for again."""
REPEATED: Time = 60 * NS
"""How long a text that was told is not told again."""
DISARM, REFUSALS = "disarm", ("denied", "not landed", "refused", "rejected")
ALERT = 1
"""MAV_SEVERITY: what is as bad is told at once, whatever it says."""
SEVERITIES = ("critical", "critical", "critical", "error", "warning")
TRUE = frozenset({"SIM_STATE", "HIL_STATE_QUATERNION"})
ANSWERS = frozenset({"COMMAND_ACK", "PARAM_VALUE", "PARAM_ERROR", "TIMESYNC"})


class Contact:
    """One autopilot. `silence`: the newest time in which nothing was heard. `truth`: of its own
    simulator, None on hardware."""

    def __init__(self, seat: Seat, profile: Profile, port: Port) -> None:
        params, context = seat.params, seat.context
        self.port, self.profile, self.target = port, profile, (port.system, AUTOPILOT)
        self.is_outside = params.position == "outside"
        self.heard, self.clock = Heard(), BootClock()
        self.requests = Requests(self.heard, target=self.target, own_system=params.own_system)
        self.parameters = Parameters(profile.integer_parameters_bytewise, target=self.target)
        self.telemetry = Telemetry(context, profile, self.heard, self.clock, self.is_outside)
        self.truth = GroundTruth(context, profile.sphere) if params.simulator else None
        self.silence: Silence | None = None
        self._alive: Time | None = None
        self._text: Text | None = None
        self._told: dict[str, Time] = {}
        self._kept: list[Text] = []
        port.want({*self.heard.heeds, *self.telemetry.heeds, *profile.streams, *ANSWERS})
        if self.truth is not None:
            port.want(TRUE)

    @property
    def unheeded(self) -> str:
        """Why it may not heed what it is asked; empty where nothing is known."""
        if self.port.counts.signed:
            return "; what it sends is signed: give the driver its `key`"
        return ""

    def age(self, now: Time) -> float:
        """Seconds since anything was heard; zero before."""
        return 0.0 if self._alive is None else (now - self._alive) / NS

    def listen(self, chores: Chores, now: Time) -> None:
        """Hear what came."""
        messages = self.port.take()
        if not messages:
            return
        gap = 0 if self._alive is None else now - self._alive
        self._alive = now
        if gap > SHORTEST:
            self.silence = Silence(now, gap / NS)
        if gap > FORGETS:
            chores.begin_anew()
        for message in messages:
            self._hear(message, chores, now)

    def said(self, *, is_disarming: bool) -> Sequence[Said]:
        """What it said of warning or worse since the last call, each thing but once a minute. Why
        it does not disarm is kept back while that is tried again, and told once it is not."""
        fresh = self._fresh()
        if not fresh and not self._kept:
            return ()
        if is_disarming:
            self._kept += (text for text in fresh if _refuses_to_disarm(text))
            fresh = [text for text in fresh if not _refuses_to_disarm(text)]
        elif self._kept:
            fresh = [*(self._kept if self.heard.armed else ()), *fresh]
            self._kept = []
        said = []
        for time, severity, text in fresh:
            told = self._told.get(text)
            if severity <= WARNING and (told is None or time - told > REPEATED):
                self._told[text] = time
                said.append(Said(SEVERITIES[severity], text))
        return said

    def _fresh(self) -> list[Text]:
        """Its texts since the last call, oldest first."""
        texts = self.heard.texts
        if not texts or texts[-1] is self._text:
            return []
        fresh = list(takewhile(lambda text: text is not self._text, reversed(texts)))
        self._text = texts[-1]
        return fresh[::-1]

    def _hear(self, message: Message, chores: Chores, now: Time) -> None:
        sort = message.get_type()
        self.heard.hear(message, now)
        if sort == "COMMAND_ACK":
            self.requests.hear(message, now)
        elif sort in {"PARAM_VALUE", "PARAM_ERROR"}:
            self.parameters.hear(message, now)
        elif sort == "TIMESYNC":
            for answer in chores.sync.hear(message, now):
                self.port.send(answer)
        elif sort in TRUE:
            if self.truth is not None:
                self.truth.hear(message, now, on_ground=self.heard.landed is Landed.GROUND)
        else:
            self.telemetry.hear(message, now)


def _refuses_to_disarm(text: Text) -> bool:
    words = text.text.lower()
    return text.severity > ALERT and DISARM in words and any(word in words for word in REFUSALS)
