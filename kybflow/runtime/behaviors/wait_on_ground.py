"""Stay on the ground with the rotors at rest; never ends by itself.

Its setpoint is always IDLE, so it needs neither tracker nor estimate. The states `landed` and
`fault` run it; leave it with `next`.
"""

from __future__ import annotations

from kybflow.core.signals import Setpoint, SetpointKind, Tick
from kybflow.core.units import Vec3
from kybflow.flight.motion import IDLE
from kybflow.parts import GROUND, Behavior, Footprint, params


@params
class WaitOnGroundParams:
    """No parameters."""


class WaitOnGround(
    Behavior[WaitOnGroundParams],
    flight=GROUND >> GROUND,
    emits=SetpointKind.IDLE,
    needs_estimate=False,
):
    def update(self, tick: Tick) -> Setpoint:
        return IDLE

    @classmethod
    def footprint(cls, params: WaitOnGroundParams, entry: Vec3 | None) -> Footprint | None:
        return Footprint(() if entry is None else (entry,), 0.0, entry, is_endless=True)
