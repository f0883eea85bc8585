"""What is known of a vehicle's payload, and what may be asked of the servo that holds it."""

from __future__ import annotations

from kybflow.core.signals import NS, Estimate, Payload, PayloadState, Time
from kybflow.runtime.events import Events


class PayloadTracker:
    """`state` is where the payload is as the vehicle acknowledged it, None while nobody knows;
    `releases` is how often it let it go. It is let go once: until the servo has closed again it
    opens no second time, whoever asks, however often, in whatever state of the mission."""

    def __init__(self, vehicle: str, events: Events) -> None:
        self.state: PayloadState | None = None
        self.releases = 0
        self._vehicle, self._events = vehicle, events
        self._said: Payload | None = None
        self._asked: Time | None = None

    def wants(self, is_open: bool, now: Time, at: str) -> bool:
        """Whether the servo should be asked to open or to close."""
        if is_open and self.state is PayloadState.RELEASED:
            self._events.tell("payload_already_released", self._vehicle, at)
            return False
        if not is_open:
            self._asked = None
        elif self._asked is None:
            self._asked = now
        return self._said is None or self._said.is_open is not is_open

    def hear(self, said: Payload, estimate: Estimate | None, now: Time) -> None:
        """The vehicle says something of its payload."""
        self._said = said
        before, self.state = self.state, self._meant(said)
        if self.state is before:
            return
        if self.state is PayloadState.RELEASED:
            took = None if self._asked is None else (now - self._asked) / NS
            self._asked = None
            self.releases += 1
            x, y, z = (None, None, None) if estimate is None else estimate.position
            self._events.tell("payload_released", self._vehicle, x=x, y=y, z=z, took=took)
        elif self.state is PayloadState.ABOARD and before is not None:
            self._events.tell("payload_loaded", self._vehicle)

    def _meant(self, said: Payload) -> PayloadState | None:
        """An open servo has released what was on board, or what was to be released; unless the
        vehicle says that it is still there."""
        if said.is_open and said.aboard:
            return self.state
        if said.is_open:
            had = self.state in (PayloadState.ABOARD, PayloadState.RELEASED)
            return PayloadState.RELEASED if had or self._asked is not None else PayloadState.ABSENT
        if said.aboard is None:
            return None
        return PayloadState.ABOARD if said.aboard else PayloadState.ABSENT
