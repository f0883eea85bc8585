"""Tracks a vehicle's payload by the reports on its servo."""

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
        self._report: Payload | None = None
        self._requested: Time | None = None

    def wants(self, is_open: bool, now: Time, at: str) -> bool:
        """Return whether to request the servo to open or to close; it may be so already."""
        if is_open and self.state is PayloadState.RELEASED:
            self._events.emit(PayloadAlreadyReleased(), self._vehicle, at)
            return False
        if not is_open:
            self._requested = None
        elif self._requested is None:
            self._requested = now
        return self._report is None or self._report.is_open is not is_open

    def update(self, report: Payload, estimate: Estimate | None, now: Time) -> None:
        """Process a report of the vehicle on its payload."""
        self._report = report
        before, self.state = self.state, self._meant(report)
        if self.state is before:
            return
        if self.state is PayloadState.RELEASED:
            took = None if self._requested is None else (now - self._requested) / NS
            self._requested = None
            self.releases += 1
            x, y, z = (None, None, None) if estimate is None else estimate.position
            self._events.emit(PayloadReleased(x=x, y=y, z=z, took=took), self._vehicle)
        elif self.state is PayloadState.ABOARD and before is not None:
            self._events.emit(PayloadLoaded(), self._vehicle)

    def _meant(self, report: Payload) -> PayloadState | None:
        """Return the state that a report means. An open servo has released a payload that was
        there or was to be released, unless the vehicle reports it as still there."""
        if report.is_open and report.aboard:
            return self.state
        if report.is_open:
            had = self.state in (PayloadState.ABOARD, PayloadState.RELEASED)
            released = had or self._requested is not None
            return PayloadState.RELEASED if released else PayloadState.ABSENT
        if report.aboard is None:
            return None
        return PayloadState.ABOARD if report.aboard else PayloadState.ABSENT
