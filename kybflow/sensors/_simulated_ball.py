"""Measurements of a moving obstacle by a simulated sensor, computed from its true position."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kybflow.core.geometry import LEVEL, ZERO, scale, sub
from kybflow.core.signals import NS, Command, Measurement, Time, Truth
from kybflow.parts import Link, Stream
from kybflow.world.shapes import MovingSphere

_STEP = 1e-3


class SimulatedBall(Stream):
    """A sensor's measurements of a ball. open: opens the sensor on a link whose true state is the
    ball's."""

    def __init__(self, ball: MovingSphere, open: Callable[[Link], Stream]) -> None:
        self._ball = _Ball(ball)
        self._stream = open(self._ball)

    def read(self, now: Time) -> Sequence[Measurement]:
        self._ball.now = now
        return self._stream.read(now)

    def close(self) -> None:
        self._stream.close()


class _Ball(Link):
    def __init__(self, path: MovingSphere) -> None:
        self._path = path
        self.now: Time = 0

    def read(self, now: Time) -> Sequence[Measurement]:
        return ()

    def send(self, command: Command, now: Time) -> None:
        """A ball takes no commands."""

    def truth(self) -> Truth | None:
        seconds = self.now / NS
        place = self._path.at(seconds)
        gone = sub(place, self._path.at(max(seconds - _STEP, 0.0)))
        return Truth(place, scale(gone, 1.0 / _STEP), LEVEL, ZERO)
