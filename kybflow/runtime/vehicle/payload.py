"""Tracks a vehicle's payload, based on the reports of its servo."""

from __future__ import annotations

from kybflow.core.signals import NS, Estimate, Payload, PayloadState, Time
from kybflow.parts.events import PayloadAlreadyReleased, PayloadLoaded, PayloadReleased
from kybflow.runtime.events import Events


class PayloadTracker:
    """Tracks a vehicle's payload. After a release the servo opens again only once it has closed.

    state: the payload's state according to the vehicle's reports, None while unknown.
    releases: how often the vehicle has released its payload.
    """

    def __init__(self, vehicle: str, events: Events) -> None:
        self.state: PayloadState | None = None
        self.releases = 0
        self._vehicle, self._events = vehicle, events
        self._report: Payload | None = None
        self._requested: Time | None = None

    def wants(self, is_open: bool, now: Time, at: str) -> bool:
        """Return whether the servo must still be requested to open or close; False if it already
        has, or if the payload was released before."""
        if is_open and self.state is PayloadState.RELEASED:
            self._events.emit(PayloadAlreadyReleased(), self._vehicle, at)
            return False
        if not is_open:
            self._requested = None
        elif self._requested is None:
            self._requested = now
        return self._report is None or self._report.is_open is not is_open

    def update(self, report: Payload, estimate: Estimate | None, now: Time) -> None:
        """Process a report on the payload; emit an event if it was released or loaded."""
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
        """Return the payload state that a report implies, None if it is unclear. An open servo has
        released a payload that was aboard or whose release was requested, unless the vehicle
        reports the payload as still aboard."""
        if report.is_open and report.aboard:
            return self.state
        if report.is_open:
            had = self.state in (PayloadState.ABOARD, PayloadState.RELEASED)
            released = had or self._requested is not None
            return PayloadState.RELEASED if released else PayloadState.ABSENT
        if report.aboard is None:
            return None
        return PayloadState.ABOARD if report.aboard else PayloadState.ABSENT
