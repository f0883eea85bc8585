"""Schedule the tracker's gain by speed.

derivative = slow + s (fast - slow),   s = |v_setpoint| / speed, at most 1, in quarters

What is asked of the setpoint has no noise, so that the gain does not flicker between two quarters.
"""

from __future__ import annotations

from typing import ClassVar

from kybflow.core.geometry import ZERO, norm
from kybflow.core.signals import Retune, Setpoint, SetpointKind, Tick
from kybflow.core.units import Number, Speed
from kybflow.parts import Processor, param, params
from kybflow.world.vehicle_context import VehicleContext

_STEPS = 4


@params
class GainsBySpeedParams:
    slow: Number = param("The tracker's `derivative` at rest.", above=0.0)
    fast: Number = param("The tracker's `derivative` from `speed` on.", above=0.0)
    speed: Speed = param("From which speed of the setpoint on it is `fast`.", default=1.0, above=0)


class GainsBySpeed(Processor[GainsBySpeedParams]):
    """Leaves the setpoint alone; its first call gives the gain, too."""

    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        kind: kind for kind in (SetpointKind.POSITION, SetpointKind.VELOCITY)
    }
    retunes = frozenset({"derivative"})

    def __init__(self, params: GainsBySpeedParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._step = -1

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Retune:
        p = self.params
        share = min(norm(setpoint.velocity or ZERO) / p.speed, 1.0)
        step = round(_STEPS * share)
        if step == self._step:
            return setpoint
        self._step = step
        return Retune(setpoint, {"derivative": p.slow + step / _STEPS * (p.fast - p.slow)})
