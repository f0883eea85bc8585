"""The output that holds the payload: asked for, acknowledged, and seen to have moved.

An acknowledgement is not enough where the autopilot tells what its outputs do: some acknowledge
what moves nothing. Where it is not known what an output is for, what may move it is tried in turn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Payload, Time
from kybflow.drivers.mavlink.control.requests import CommandRequest, name_of
from kybflow.drivers.mavlink.firmware import Output, PayloadCommand
from kybflow.drivers.mavlink.protocol import codec

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.contact import Contact

SEEN = 2.0
"""Seconds in which an output must have moved after it was acknowledged; and how long ago its
outputs may have been told."""


class PayloadGrip:
    """output: what the payload hangs on."""

    def __init__(self, contact: Contact, output: Output) -> None:
        self._profile, self._status = contact.profile, contact.status
        self._requests, self._parameters = contact.requests, contact.parameters
        self._output = output
        self._is_open: bool | None = None
        self._left: list[PayloadCommand] = []
        self._said: list[str] = []
        self._request: CommandRequest | None = None
        self._accepted: Time | None = None

    def ask(self, is_open: bool, now: Time) -> Payload | None:
        """Ask for it, once a tick until it is so; what is then so. Raises Refused, and the next
        call begins anew."""
        if self._is_open is not is_open:
            self._begin(is_open)
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

    def _begin(self, is_open: bool) -> None:
        number, parameter, _ = self._output
        function = self._parameters.values.get(parameter)
        self._left = list(self._profile.grip(number, is_open, function))
        if not self._left:
            raise Refused(
                f"output {number} is for something else: {parameter} is {function or 0.0:g}"
            )
        self._is_open, self._said, self._request = is_open, [], None

    def _is_done(self, is_open: bool, now: Time) -> bool:
        """Whether what was acknowledged has been seen, where it can be."""
        if self._accepted is None:
            self._accepted = now
        told = self._status.at.get("SERVO_OUTPUT_RAW")
        shown = self._left[0].seen and self._output.shown
        if not shown or told is None or now - told > SEEN * NS:
            return True
        if told >= self._accepted:
            pulses = codec.payload(self._status.servos, self._output.number, now)
            if pulses is not None and pulses.is_open is is_open:
                return True
        if now - self._accepted > SEEN * NS:
            rests = "" if self._status.armed else " (it is disarmed)"
            name, (number, parameter, _) = name_of(self._left[0].command), self._output
            self._next(f"it took {name}, but output {number} does not move{rests}: see {parameter}")
        return False

    def _next(self, said: str) -> None:
        """Try what is left. Raises Refused where nothing is."""
        self._said.append(said)
        self._request = None
        del self._left[0]
        if not self._left:
            self._is_open = None
            raise Refused("; ".join(dict.fromkeys(self._said)))
