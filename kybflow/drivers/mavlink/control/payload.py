"""The output that holds the payload: commands to it, their acknowledgement, and its reported
movement.

If the autopilot reports its outputs, an acknowledgement is not enough: some autopilots acknowledge
a command that moves nothing. If the function of an output is unknown, the commands that may move it
are tried in turn.
"""

from __future__ import annotations

from types import MappingProxyType

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Payload, Time
from kybflow.drivers.mavlink.control.requests import CommandRequest, CommandRequests, name_of
from kybflow.drivers.mavlink.firmware import FirmwareProfile, Output, PayloadCommand
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.telemetry.parameters import AutopilotParameters
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

STREAMS = MappingProxyType({"SERVO_OUTPUT_RAW": 10.0})
"""The stream that reports the position of the output, Hz."""
OUTPUT_TIMEOUT_S = 2.0
"""Seconds within which an output must move after the acknowledgement; also the greatest age of a
report of the outputs."""


class PayloadGrip:
    """Opens and closes the payload's grip. output: the output that moves it."""

    def __init__(
        self,
        profile: FirmwareProfile,
        status: ReceivedStatus,
        requests: CommandRequests,
        parameters: AutopilotParameters,
        output: Output,
    ) -> None:
        self._profile, self._status = profile, status
        self._requests, self._parameters = requests, parameters
        self._output = output
        self._is_open: bool | None = None
        self._left: list[PayloadCommand] = []
        self._refusals: list[str] = []
        self._request: CommandRequest | None = None
        self._accepted: Time | None = None

    def ask(self, is_open: bool, now: Time) -> Payload | None:
        """Open or close the grip. Called once a tick until it returns the payload's state. Raises
        Refused; the next call then starts over."""
        if self._is_open is not is_open:
            number, parameter, _ = self._output
            function = self._parameters.values.get(parameter)
            self._left = list(self._profile.grip(number, is_open, function))
            if not self._left:
                raise Refused(
                    f"output {number} has another function: {parameter} is {function or 0.0:g}"
                )
            self._is_open, self._refusals, self._request = is_open, [], None
        if self._request is None:
            first = self._left[0]
            self._accepted = None
            self._request = self._requests.ask(first.command, *first.params, now=now)
        outcome = self._request.outcome
        if outcome == "refused":
            name = name_of(self._request.command)
            self._next(f"{name} was {self._request.words}")
        elif outcome == "silent":
            self._request = None
        elif outcome == "accepted" and self._is_done(is_open, now):
            self._is_open = self._request = None
            return Payload(now, is_open, None)
        return None

    def _is_done(self, is_open: bool, now: Time) -> bool:
        """Return whether the acknowledged movement is reported; always true if the output is not
        reported."""
        if self._accepted is None:
            self._accepted = now
        reported = self._status.at.get("SERVO_OUTPUT_RAW")
        shown = self._left[0].seen and self._output.shown
        if not shown or reported is None or now - reported > OUTPUT_TIMEOUT_S * NS:
            return True
        if reported >= self._accepted:
            pulses = codec.payload(self._status.servos, self._output.number, now)
            if pulses is not None and pulses.is_open is is_open:
                return True
        if now - self._accepted > OUTPUT_TIMEOUT_S * NS:
            rests = "" if self._status.armed else " (it is disarmed)"
            name, (number, parameter, _) = name_of(self._left[0].command), self._output
            self._next(f"it took {name}, but output {number} does not move{rests}: see {parameter}")
        return False

    def _next(self, refusal: str) -> None:
        """Try the next command. Raises Refused if there is none left."""
        self._refusals.append(refusal)
        self._request = None
        del self._left[0]
        if not self._left:
            self._is_open = None
            raise Refused("; ".join(dict.fromkeys(self._refusals)))
