"""What is found wrong with something that is watched, and when that counts: the one mechanism for
bodies of motion capture and for cameras.

A single odd observation is an error of measurement. What persists is a finding: `CONFIRMED`
observations in a row that agree with one another make a jump (`kybflow.flight.pose_track`), and so
many good ones in a row end what was wrong (`Trouble`). A jump to where another vehicle was is a
swap (`nearest`).
"""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import Vec3, distance
from kybflow.flight.pose_track import CONFIRMED


class Trouble:
    """What is wrong with one subject, None while nothing is. good: good observations since."""

    __slots__ = ("finding", "good")

    def __init__(self) -> None:
        self.finding: VehicleEvent | None = None
        self.good = 0

    def found(self, finding: VehicleEvent) -> VehicleEvent:
        """Count `finding` as wrong from now on; return it."""
        self.finding = finding
        return finding

    def count_anew(self) -> None:
        """Forget the good observations: the last one was not."""
        self.good = 0

    def is_known(self, event: type[VehicleEvent]) -> bool:
        """Whether this was found, and goes on."""
        return isinstance(self.finding, event)

    def is_over(self) -> bool:
        """Take note of a good observation; whether it confirms that the subject is well again."""
        self.good += 1
        if self.finding is None or self.good < CONFIRMED:
            return False
        self.finding = None
        return True


def nearest(position: Vec3, others: Iterable[tuple[str, Vec3, float]]) -> str:
    """The vehicle that was at `position`; empty when none was. others: (vehicle, where it was, how
    far off that may be); of several the one nearest by that measure."""
    best, whose = 1.0, ""
    for vehicle, place, room in others:
        share = distance(position, place) / room
        if share < best:
            best, whose = share, vehicle
    return whose
