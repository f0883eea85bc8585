"""The state of a vehicle that is followed, according to the messages that it publishes."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, distance, heading_of, scale
from kybflow.core.signals import NS, NeighbourState, Tick

_FOLLOWING_DISTANCE = 0.3
"""Largest distance (m) of a vehicle from its setpoint at which it counts as following it."""


class Leading(NamedTuple):
    """The motion of the followed vehicle now: its setpoint if it follows that, otherwise its
    estimate. World frame, SI."""

    position: Vec3
    velocity: Vec3
    acceleration: Vec3
    heading: float
    rate: float


class Leader:
    """Receives the messages of the followed vehicle. trouble: why the vehicle can't be followed
    now, empty if it can. lost: seconds for which it could not be followed."""

    def __init__(self, name: str) -> None:
        self.trouble, self.lost = "", 0.0
        self._name = name

    def heard(self, tick: Tick, delay: float, freshness: float) -> Leading | None:
        """Return the vehicle's motion now, or None while it is unknown. Must be called once a tick.
        delay: the least age of the messages (s). freshness: the largest age (s)."""
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
        if distance(wanted.position, position) < _FOLLOWING_DISTANCE:
            position, velocity = wanted.position, wanted.velocity
            acceleration = wanted.acceleration or ZERO
        if wanted.heading is not None:
            heading, rate = wanted.heading, wanted.heading_rate
    ahead = add(scale(velocity, age), scale(acceleration, 0.5 * age * age))
    velocity = add(velocity, scale(acceleration, age))
    return Leading(add(position, ahead), velocity, acceleration, heading + rate * age, rate)
