"""A moving obstacle as a sensor of simulated vehicles sees it: on its path, not where it is known
to be."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kybflow.core.geometry import LEVEL, ZERO, scale, sub
from kybflow.core.signals import NS, Command, Measurement, Time, Truth
from kybflow.parts import Link, Stream
from kybflow.world.moving_sphere import MovingSphere

_STEP = 1e-3


class SimulatedBall(Stream):
    """What a sensor gives of a ball. open: opens the sensor on a link that shows the ball's truth,
    as others show a vehicle's."""

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
        """Nobody commands it."""

    def truth(self) -> Truth | None:
        seconds = self.now / NS
        place = self._path.at(seconds)
        gone = sub(place, self._path.at(max(seconds - _STEP, 0.0)))
        return Truth(place, scale(gone, 1.0 / _STEP), LEVEL, ZERO)
