"""A vehicle that is followed, by what it publishes."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, distance, heading_of, scale
from kybflow.core.signals import NS, NeighbourState, Tick

_BESIDE = 0.3
"""Largest distance (m) from its setpoint of a vehicle that follows it."""


class Leading(NamedTuple):
    """Where the followed vehicle is now: its setpoint if it follows that, else its estimate. World
    frame."""

    position: Vec3
    velocity: Vec3
    acceleration: Vec3
    heading: float
    rate: float


class Leader:
    """trouble: why it can't be followed now, empty while it can. lost: seconds of that."""

    def __init__(self, name: str) -> None:
        self.trouble, self.lost = "", 0.0
        self._name = name

    def heard(self, tick: Tick, delay: float, freshness: float) -> Leading | None:
        """Return where it is now, None while that is unknown. Called once a tick."""
        news = tick.neighbours.heard(self._name, tick.now - round(delay * NS))
        age = 0.0 if news is None else (tick.now - news.time) / NS
        if news is None:
            self.trouble = f"`{self._name}` has not been heard"
        elif age > freshness:
            self.trouble = f"`{self._name}` is silent for {age:.2f} s"
        elif news.estimate is None:
            self.trouble = f"`{self._name}` has no estimate"
        else:
            self.trouble, self.lost = "", 0.0
            return _now(news, age)
        self.lost += tick.dt
        return None


def _now(news: NeighbourState, age: float) -> Leading:
    estimate, wanted = news.estimate, news.setpoint
    assert estimate is not None
    position, velocity = estimate.position, estimate.velocity
    acceleration, heading, rate = ZERO, heading_of(estimate.attitude), 0.0
    if wanted is not None and wanted.position is not None and wanted.velocity is not None:
        if distance(wanted.position, position) < _BESIDE:
            position, velocity = wanted.position, wanted.velocity
            acceleration = wanted.acceleration or ZERO
        if wanted.heading is not None:
            heading, rate = wanted.heading, wanted.heading_rate
    ahead = add(scale(velocity, age), scale(acceleration, 0.5 * age * age))
    velocity = add(velocity, scale(acceleration, age))
    return Leading(add(position, ahead), velocity, acceleration, heading + rate * age, rate)
