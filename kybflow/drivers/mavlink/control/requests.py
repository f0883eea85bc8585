"""Commands to an autopilot, with acknowledgements and retries.

COMMAND_ACK contains only the id of the command, so only one request of each command is under way at
a time. A newer request on the same subject replaces the older one, which is not sent again: a late
retry must not arm a vehicle that was disarmed in the meantime. The first acknowledgement after that
is taken as the older request's.

A request is sent again after its `timeout`, then after twice as long each time, up to 2 s. An
acknowledgement doesn't mean that the command was carried out, and an autopilot that refuses now may
accept in a second. So `Retries` repeats the command, with pauses that double, until the caller sees
the effect in what the autopilot reports."""

from __future__ import annotations

from typing import Literal

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

Outcome = Literal["waiting", "accepted", "refused", "silent"]

WAIT_S = 0.3
MOST_ATTEMPTS = 5
MAX_PAUSE_NS: Time = 2 * NS
WORDS_LATE: Time = 3 * NS // 10
"""How long after a refusal the text with its reason may arrive."""
PROGRESS_TIMEOUT_NS: Time = 10 * NS
"""How long a command in progress may go without a report."""

ACCEPTED, IN_PROGRESS = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS
RESULTS = (
    "ACCEPTED", "TEMPORARILY_REJECTED", "DENIED", "UNSUPPORTED", "FAILED", "IN_PROGRESS",
    "CANCELLED", "COMMAND_LONG_ONLY", "COMMAND_INT_ONLY", "UNSUPPORTED_MAV_FRAME",
    "NOT_IN_CONTROL",
)  # fmt: skip
"""The names of MAV_RESULT, including those that pymavlink's dialect lacks."""
NUMBERED = frozenset(
    {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_DO_SET_SERVO,
        mavlink.MAV_CMD_DO_SET_RELAY,
        mavlink.MAV_CMD_DO_GRIPPER,
    }
)
"""Commands whose first parameter identifies their subject."""


class CommandRequest:
    """One command, from its request to its end. `words`: why the command was not accepted, as far
    as the autopilot reports it; empty while it waits and if it was accepted."""

    def __init__(
        self, command: int, params: tuple[float, ...], asked: Time, timeout: float, attempts: int
    ) -> None:
        self.command, self.params, self.asked = command, params, asked
        self.outcome: Outcome = "waiting"
        self.words = ""
        self.sent = 0
        self.attempts = attempts
        self.refusal = ""
        self.is_in_progress = False
        self.next: Time = asked
        self.wait: Time = round(timeout * NS)

    @property
    def subject(self) -> tuple[float, ...]:
        """What the request is about; a newer request on the same subject replaces it."""
        return (self.command, self.params[0]) if self.command in NUMBERED else (self.command,)

    def end(self, outcome: Outcome, words: str = "") -> None:
        self.outcome, self.words = outcome, words


class CommandRequests:
    """The requests to one autopilot.

    status: holds its texts.
    target: its system and component id.
    own_system: our system id; acknowledgements addressed to others are ignored. With 0 all are
    taken."""

    def __init__(
        self, status: ReceivedStatus, *, target: tuple[int, int], own_system: int = 0
    ) -> None:
        self._status, self._target, self._own = status, target, own_system
        self._waiting: list[CommandRequest] = []
        self._replaced: list[CommandRequest] = []

    def ask(
        self,
        command: int,
        *params: float,
        now: Time,
        timeout: float = WAIT_S,
        attempts: int = MOST_ATTEMPTS,
    ) -> CommandRequest:
        """Request a command (MAV_CMD) with up to seven parameters; missing ones are 0. If an
        identical request is still waiting, return that one. timeout: seconds until the command is
        sent again. attempts: how often it is sent at most."""
        filled = (*map(float, params), *(0.0,) * (7 - len(params)))
        request = CommandRequest(command, filled, now, timeout, attempts)
        for other in self._waiting:
            if other.subject != request.subject or other.refusal:
                continue
            if repr(other.params) == repr(filled):  # NaN equals NaN here
                return other
            other.end("refused", "a newer request replaced it")
            if other.sent and not other.is_in_progress:
                self._replaced.append(other)
        self._waiting.append(request)
        self._tidy()
        return request

    def handle(self, message: Message, now: Time) -> None:
        """Handle a COMMAND_ACK; other messages are ignored."""
        if message.get_type() != "COMMAND_ACK":
            return
        if self._own and message.target_system not in (0, self._own):
            return
        command = message.command
        if any(request.command == command for request in self._replaced):
            self._replaced = [r for r in self._replaced if r.command != command]
            return
        result = message.result
        for request in self._waiting:
            if request.command != command or not request.sent or request.refusal:
                continue
            if result == ACCEPTED:
                request.end("accepted")
            elif result == IN_PROGRESS:
                request.is_in_progress = True
                request.next = now + PROGRESS_TIMEOUT_NS
            else:
                request.refusal = RESULTS[result] if result < len(RESULTS) else f"result {result}"
                request.next = now + WORDS_LATE
            break
        self._tidy()

    def due(self, now: Time) -> list[Message]:
        """Return the messages to send now, oldest first, and end requests that were refused or not
        answered. Must be called every tick."""
        if not (self._waiting or self._replaced):
            return []
        self._replaced = [request for request in self._replaced if now < request.next]
        for request in self._waiting:
            if now >= request.next:
                self._expire(request)
        self._tidy()
        messages = []
        first: set[int] = set()
        for request in self._waiting:
            if request.refusal or request.command in first:
                continue  # it waits for its reason, or for an older request of the command
            first.add(request.command)
            if now < request.next:
                continue
            request.next = now + request.wait
            request.wait = min(2 * request.wait, MAX_PAUSE_NS)
            again = min(request.sent, 255)
            request.sent += 1
            messages.append(
                codec.command_long(self._target, request.command, *request.params, again=again)
            )
        return messages

    def _expire(self, request: CommandRequest) -> None:
        """End the request if it was refused or has timed out."""
        if request.refusal:
            texts = self._status.words(request.asked)
            why = f": {texts}" if texts else ", for an unknown reason"
            request.end("refused", f"refused ({request.refusal}){why}")
        elif request.is_in_progress:
            request.end("silent", f"{name_of(request.command)} began, but its end was not reported")
        elif request.sent >= request.attempts:
            tries = "once" if request.sent == 1 else f"{request.sent} times"
            request.end("silent", f"no answer to {name_of(request.command)}, sent {tries}")

    def _tidy(self) -> None:
        self._waiting = [r for r in self._waiting if r.outcome == "waiting"]


def name_of(command: int) -> str:
    """Return a command's name in MAVLink, such as `DO_SET_MODE`."""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return entry.name.removeprefix("MAV_CMD_") if entry else f"command {command}"


EFFECT_TIMEOUT_S = 1.5
"""Seconds within which the effect of an accepted command must show; heartbeats arrive once a
second."""


class Retries:
    """Repeats one command until its effect shows.

    first, most: the shortest and the longest pause between attempts, seconds.
    shown: the shortest pause after an acceptance, seconds.
    refusal: the autopilot's last refusal; empty if there is none."""

    def __init__(
        self, requests: CommandRequests, command: int, params: tuple[float, ...],
        first: float = 0.5, most: float = 4.0, shown: float = EFFECT_TIMEOUT_S,
    ) -> None:  # fmt: skip
        self.refusal = ""
        self._requests, self._command, self._params = requests, command, params
        self._pause, self._most, self._shown = first, most, shown
        self._request: CommandRequest | None = None
        self._due: Time | None = None

    def step(self, now: Time) -> None:
        """Send the command if it is due. Called once a tick until the effect of the command
        shows."""
        request = self._request
        if request is not None and request.outcome != "waiting":
            self._request = None
            accepted = request.outcome == "accepted"
            self.refusal = "" if accepted else request.words
            pause = max(self._pause, self._shown) if accepted else self._pause
            self._due = now + round(pause * NS)
            self._pause = min(2.0 * self._pause, self._most)
        if self._request is None and (self._due is None or now >= self._due):
            self._request = self._requests.ask(
                self._command, *self._params, now=now, timeout=min(self._pause, WAIT_S), attempts=2
            )

    def drop(self) -> None:
        """Withdraw an unanswered request, so that it is not sent again."""
        if self._request is not None and self._request.outcome == "waiting":
            self._request.end("silent", "it was withdrawn")


class Modes:
    """The modes of one autopilot.

    wanted: the requested mode's name in the profile, None if no mode is requested.
    was_in_force: whether that mode has been in force since the request.
    before: the custom_mode before the first request."""

    def __init__(
        self, profile: FirmwareProfile, status: ReceivedStatus, requests: CommandRequests
    ) -> None:
        self.wanted: str | None = None
        self.was_in_force = False
        self.before: int | None = None
        self._profile, self._status, self._requests = profile, status, requests
        self._asking: Retries | None = None

    @property
    def reported(self) -> str:
        """The firmware's name of the mode that the autopilot reports."""
        mode = self._status.mode
        return "no known mode" if mode is None else self._profile.mode_name(mode)

    def is_in(self, name: str) -> bool:
        """Return whether the autopilot reports this mode of the profile."""
        return self._status.mode == self._profile.modes[name]

    @property
    def is_manual(self) -> bool:
        """Whether the autopilot reports a mode that a person flies."""
        return self.reported in self._profile.manual_modes

    @property
    def in_force(self) -> bool:
        """Whether the requested mode is in force."""
        return self.wanted is not None and self.is_in(self.wanted)

    @property
    def has_left(self) -> bool:
        """Whether the requested mode was in force and no longer is."""
        return self.was_in_force and not self.in_force

    def want(self, name: str | None) -> None:
        """Request this mode from now on; None withdraws the request."""
        if name != self.wanted:
            self._want(name)

    def again(self) -> None:
        """Request the wanted mode again after the autopilot has left it."""
        self._want(self.wanted)

    def step(self, now: Time) -> bool:
        """Send the request if it is due; return whether the mode is in force. A mode that was in
        force and was left is not requested again. Called once a tick."""
        if self.wanted is None:
            return False
        if self.before is None:
            self.before = self._status.mode
        if self.in_force:
            self.was_in_force = True
            self._drop()
            return True
        if not self.was_in_force:
            if self._asking is None:
                params = self._profile.mode_params(self._profile.modes[self.wanted])
                self._asking = Retries(self._requests, mavlink.MAV_CMD_DO_SET_MODE, params)
            self._asking.step(now)
        return False

    @property
    def trouble(self) -> str:
        """Why the requested mode is not in force, with the autopilot's refusal if there is one."""
        if self.wanted is None:
            return "no mode is requested"
        name = self._profile.mode_name(self._profile.modes[self.wanted])
        refusal = self._asking.refusal if self._asking is not None else ""
        return f"it does not change from {self.reported} to {name}" + (
            f": {refusal}" if refusal else ""
        )

    def _want(self, name: str | None) -> None:
        self.wanted, self.was_in_force = name, False
        self._drop()

    def _drop(self) -> None:
        if self._asking is not None:
            self._asking.drop()
            self._asking = None
