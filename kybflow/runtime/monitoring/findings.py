"""Rules for when a fault of a motion-capture body or of a camera begins and when it is over.

A single odd observation is a measurement error. `CONFIRMED` consecutive observations that agree
with one another are a jump (`kybflow.flight.pose_track`); as many consecutive good observations end
a fault (`Trouble`). A jump to the position of another vehicle is a swap (`nearest`).
"""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import Vec3, distance
from kybflow.flight.pose_track import CONFIRMED


class Trouble:
    """The fault of one body or camera. finding: the present fault, or None. good: the number of
    consecutive good observations so far."""

    __slots__ = ("finding", "good")

    def __init__(self) -> None:
        self.finding: VehicleEvent | None = None
        self.good = 0

    def found(self, finding: VehicleEvent) -> VehicleEvent:
        """Set the present fault; return it."""
        self.finding = finding
        return finding

    def count_anew(self) -> None:
        """Reset the count of good observations after a bad one."""
        self.good = 0

    def is_known(self, event: type[VehicleEvent]) -> bool:
        """Return whether the present fault is of this kind."""
        return isinstance(self.finding, event)

    def is_over(self) -> bool:
        """Count a good observation; return whether it ends the fault."""
        self.good += 1
        if self.finding is None or self.good < CONFIRMED:
            return False
        self.finding = None
        return True


def nearest(position: Vec3, others: Iterable[tuple[str, Vec3, float]]) -> str:
    """Return the name of the vehicle that was at `position` (m), empty if none was. others: for
    each vehicle its name, its position and the radius within which it counts as being there. Of
    several, the one whose distance is the smallest fraction of its radius is returned."""
    best, whose = 1.0, ""
    for vehicle, place, room in others:
        share = distance(position, place) / room
        if share < best:
            best, whose = share, vehicle
    return whose
