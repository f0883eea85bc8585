"""The recent estimates of a fleet. A camera's frame arrives late, so it is compared with the
estimate from the time when it was taken."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from kybflow.core.signals import NS, Estimate, Time

_KEPT = 512
CURRENT = NS // 20
"""An estimate counts as the estimate at a given time if it is at most this much older."""


class EstimateHistory:
    """The recent estimates that the vehicles flew on. is_asked: whether a monitor uses the history;
    otherwise nothing is kept, to spare the CPU's caches."""

    def __init__(self) -> None:
        self.is_asked = False
        self._kept: dict[str, deque[Estimate]] = {}

    def note(self, vehicle: str, estimate: Estimate) -> None:
        """Keep the newest estimate of a vehicle."""
        kept = self._kept.get(vehicle)
        if kept is None:
            kept = self._kept[vehicle] = deque(maxlen=_KEPT)
        kept.append(estimate)

    def at(self, vehicle: str, time: Time) -> Estimate | None:
        """Return the vehicle's estimate at `time` or shortly before, or None."""
        for estimate in reversed(self._kept.get(vehicle, ())):
            if estimate.time <= time:
                return estimate if time - estimate.time <= CURRENT else None
        return None

    def others(self, vehicle: str, time: Time) -> Iterator[tuple[str, Estimate]]:
        """Yield (name, estimate) of each other vehicle that had an estimate at `time`."""
        for other in self._kept:
            estimate = None if other == vehicle else self.at(other, time)
            if estimate is not None:
                yield other, estimate
