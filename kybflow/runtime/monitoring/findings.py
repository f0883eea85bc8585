"""When a fault of a motion-capture body or of a camera counts as found, and when as over.

A single odd observation is a measurement error. `CONFIRMED` observations in a row that agree with
one another are a jump (`kybflow.flight.pose_track`); as many good ones in a row end a fault
(`Trouble`). A jump to where another vehicle was is a swap (`nearest`).
"""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import Vec3, distance
from kybflow.flight.pose_track import CONFIRMED


class Trouble:
    """finding: the present fault, None without one. good: the good observations in a row since."""

    __slots__ = ("finding", "good")

    def __init__(self) -> None:
        self.finding: VehicleEvent | None = None
        self.good = 0

    def found(self, finding: VehicleEvent) -> VehicleEvent:
        """Set the present fault; return it."""
        self.finding = finding
        return finding

    def count_anew(self) -> None:
        """Restart the count of good observations after one that was not."""
        self.good = 0

    def is_known(self, event: type[VehicleEvent]) -> bool:
        """Return whether this is the present fault."""
        return isinstance(self.finding, event)

    def is_over(self) -> bool:
        """Note a good observation; return whether it ends the fault."""
        self.good += 1
        if self.finding is None or self.good < CONFIRMED:
            return False
        self.finding = None
        return True


def nearest(position: Vec3, others: Iterable[tuple[str, Vec3, float]]) -> str:
    """Return the vehicle that was at `position`, empty if none was. others: (vehicle, its position,
    the distance that still counts); of several, the nearest relative to that distance."""
    best, whose = 1.0, ""
    for vehicle, place, room in others:
        share = distance(position, place) / room
        if share < best:
            best, whose = share, vehicle
    return whose
