"""What is found wrong with something that is watched, and when that counts: the one mechanism for
bodies of motion capture and for cameras.

A single odd observation is an error of measurement. What persists is a finding: `CONFIRMED`
observations in a row that agree with one another make a jump (`kybflow.flight.pose_track`), and so
many good ones in a row end what was wrong (`Trouble`). A jump to where another vehicle was is a
swap (`nearest`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Time
from kybflow.flight.pose_track import CONFIRMED
from kybflow.parts.observables import EVENT_FIELDS
from kybflow.runtime.events import Events, Fields


class Finding(NamedTuple):
    """Something that was found. subject: the body or the camera, empty where it is all of them.
    value, bound: what was measured and what may be: seconds without anything new; metres (or, for
    a turn, radians) off. other: the vehicle that is where the subject seems to be. time: when it
    was true, where that is known."""

    event: str
    subject: str = ""
    value: float = 0.0
    bound: float = 0.0
    other: str = ""
    time: Time = 0


class Trouble:
    """What is wrong with one subject, None while nothing is. good: good observations since."""

    __slots__ = ("finding", "good")

    def __init__(self) -> None:
        self.finding: Finding | None = None
        self.good = 0

    def is_told(self, event: str) -> bool:
        """Whether it was told, and goes on."""
        return self.finding is not None and self.finding.event == event

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


def tell(events: Events, finding: Finding, vehicle: str, at: str, **known: Fields) -> None:
    """Tell the finding's event, with what of `known` it carries."""
    carried = EVENT_FIELDS[finding.event]
    fields = {name: value for name, value in known.items() if name in carried}
    events.tell(finding.event, vehicle, at, **fields)
