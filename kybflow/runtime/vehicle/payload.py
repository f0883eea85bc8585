"""Tracks a vehicle's payload and decides on requests to its servo."""

from __future__ import annotations

from kybflow.core.signals import NS, Estimate, Payload, PayloadState, Time
from kybflow.parts.events import PayloadAlreadyReleased, PayloadLoaded, PayloadReleased
from kybflow.runtime.events import Events


class PayloadTracker:
    """state: its state as reported by the vehicle, None while unknown. releases: how often
    the vehicle released it. After a release the servo opens again only once it has closed."""

    def __init__(self, vehicle: str, events: Events) -> None:
        self.state: PayloadState | None = None
        self.releases = 0
        self._vehicle, self._events = vehicle, events
        self._said: Payload | None = None
        self._asked: Time | None = None

    def wants(self, is_open: bool, now: Time, at: str) -> bool:
        """Return whether to request the servo to open or to close; it may be so already."""
        if is_open and self.state is PayloadState.RELEASED:
            self._events.emit(PayloadAlreadyReleased(), self._vehicle, at)
            return False
        if not is_open:
            self._asked = None
        elif self._asked is None:
            self._asked = now
        return self._said is None or self._said.is_open is not is_open

    def hear(self, said: Payload, estimate: Estimate | None, now: Time) -> None:
        """Process a report of the vehicle on its payload."""
        self._said = said
        before, self.state = self.state, self._meant(said)
        if self.state is before:
            return
        if self.state is PayloadState.RELEASED:
            took = None if self._asked is None else (now - self._asked) / NS
            self._asked = None
            self.releases += 1
            x, y, z = (None, None, None) if estimate is None else estimate.position
            self._events.emit(PayloadReleased(x=x, y=y, z=z, took=took), self._vehicle)
        elif self.state is PayloadState.ABOARD and before is not None:
            self._events.emit(PayloadLoaded(), self._vehicle)

    def _meant(self, said: Payload) -> PayloadState | None:
        """Return the state that a report means. An open servo released what was aboard or was to
        be released, unless the vehicle reports it as still aboard."""
        if said.is_open and said.aboard:
            return self.state
        if said.is_open:
            had = self.state in (PayloadState.ABOARD, PayloadState.RELEASED)
            return PayloadState.RELEASED if had or self._asked is not None else PayloadState.ABSENT
        if said.aboard is None:
            return None
        return PayloadState.ABOARD if said.aboard else PayloadState.ABSENT
