"""Raise an alarm when the vehicle is further from its setpoint than a limit.

|p_setpoint - p_estimate| > limit asks the failsafe to brake: the vehicle does not follow, and
a setpoint that runs away pulls ever harder (TeleKyb's PMPositionError, 0.5 m; there it was silent
during take-off and landing, here it acts from take-off to touch-down). The setpoint itself passes
unchanged; one without a position is not judged. An alarm that persists is returned in every tick.
"""

from __future__ import annotations

from typing import ClassVar

from kybflow.geometry import distance
from kybflow.parts import Processor, param, params
from kybflow.signals import Alarm, Reaction, Setpoint, SetpointKind, Tick
from kybflow.units import Length


@params
class PositionErrorParams:
    limit: Length = param("Largest distance from the setpoint.", default=0.5, above=0.0)


class PositionError(Processor[PositionErrorParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        kind: kind
        for kind in (SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION)
    }
    safety = True
    events = ("position_error_exceeded",)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm:
        if setpoint.position is None:
            return setpoint
        error = distance(setpoint.position, tick.known().position)
        limit = self.params.limit
        if error <= limit:
            return setpoint
        reason = f"{error:.2f} m from its setpoint, {limit:g} m allowed"
        return Alarm("position_error_exceeded", Reaction.BRAKE, reason, error, limit)
