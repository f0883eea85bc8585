"""Bob up and down on the spot: z(t) = z0 + h/2 (1 - cos(2 pi t / T)).

Position in the world frame; the motion starts and ends at rest at the entry position.
"""

from __future__ import annotations

from math import cos, pi, sin

from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import Duration, Length, Vec3
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params


@params
class BobParams:
    height: Length = param("How far up it goes.", default=0.3, above=0.0)
    period: Duration = param("Time for once up and down.", default=4.0, above=1.0)


class Bob(Behavior[BobParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """One bob, then done."""

    def __init__(self, params: BobParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._origin = entry.position
        self._heading = entry.heading

    def update(self, tick: Tick) -> Setpoint | Done:
        rate = 2 * pi / self.params.period
        phase = min(rate * tick.elapsed, 2 * pi)
        half = self.params.height / 2
        x, y, z = self._origin
        setpoint = Setpoint(
            SetpointKind.POSITION,
            (x, y, z + half * (1 - cos(phase))),
            (0.0, 0.0, half * rate * sin(phase)),
            (0.0, 0.0, half * rate * rate * cos(phase)),
            heading=self._heading,
        )
        return Done(setpoint) if phase >= 2 * pi else setpoint

    @classmethod
    def footprint(cls, params: BobParams, entry: Vec3 | None) -> Footprint | None:
        if entry is None:
            return None
        x, y, z = entry
        top = (x, y, z + params.height)
        return Footprint((entry, top), pi * params.height / params.period, exit=entry)
