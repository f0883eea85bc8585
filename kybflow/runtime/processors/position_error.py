"""Raise an alarm when the vehicle is further from its setpoint than a limit.

If |p_setpoint - p_estimate| > limit, the failsafe is requested to brake: the vehicle does not
follow, and a setpoint that runs away pulls it harder and harder (TeleKyb's PMPositionError, 0.5 m;
there it was silent during take-off and landing, here it acts from take-off to touch-down). For a
velocity setpoint the distance is the length of e, by which the vehicle has recently fallen behind,

    e' = v_setpoint - v_estimate - e / T,    T = 2 s,

so that a constant velocity error of 0.25 m/s makes 0.5 m. The setpoint itself passes unchanged;
acceleration setpoints are not checked. An alarm that persists is returned in every tick.

In the first 3 s after a lift-off the limit is 1.6 times as large. The floor holds a vehicle against
the wind, which pushes it aside once it flies, until the tracker's integral has met the wind: by
0.47 m with an emulated ArduPilot in a wind of 5 m/s, 1.8 s after the lift-off, and by more than the
limit in ArduPilot's own simulator. A vehicle that is in the air at its first setpoint has no such
time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from kybflow.core.geometry import ZERO, add, distance, norm, scale, sub
from kybflow.core.signals import Alarm, Reaction, Setpoint, SetpointKind, Tick
from kybflow.core.units import Length
from kybflow.parts import Objection, Processor, param, params
from kybflow.world.ground import height_in_the_air
from kybflow.world.vehicle_context import VehicleContext

_AVERAGING_S = 2.0
_LIFTED_HEIGHT, _SETTLING_TIME_S, _SETTLING_FACTOR = 0.05, 3.0, 1.6
"""Height (m) above where it stood from which a vehicle flies, for how long (s) the limit is then
larger, and how many times."""
_USUAL_DEVIATION = 0.02
"""Distance (m) from its setpoint within which a vehicle mostly stays in still air."""


@params
class PositionErrorParams:
    limit: Length = param(
        "Largest distance from the setpoint.", default=0.5, above=0.0, tightens="down"
    )


class PositionError(Processor[PositionErrorParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        kind: kind
        for kind in (SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION)
    }
    safety = True
    events = ("position_error_exceeded",)

    @classmethod
    def objections(
        cls, params: PositionErrorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        fence, limit = context.fence, params.limit
        if limit < _USUAL_DEVIATION:
            reason = f"alarms at once: good tracking leaves {_USUAL_DEVIATION * 100:.0f} cm"
            yield Objection("limit", reason, "write `limit: 50 cm`", is_doubt=True)
        if fence is not None and limit > 0.5 * min(fence.size[:2]):
            reason = f"alarms beyond the walls: the fence is {min(fence.size[:2]):.3g} m wide"
            yield Objection("limit", reason, "write `limit: 50 cm`", is_doubt=True)

    def __init__(self, params: PositionErrorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._context, self._behind = context, ZERO
        self._stood: float | None = None
        self._settling = _SETTLING_TIME_S

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm:
        position, limit = setpoint.position, self.params.limit
        if self._settling > 0.0:
            limit = self._settling_limit(limit, tick)
        if position is not None:
            self._behind = ZERO
            error = distance(position, tick.known().position)
        elif (velocity := setpoint.velocity) is not None:
            # by how many metres the vehicle has recently fallen behind
            missing = sub(velocity, tick.known().velocity)
            change = sub(missing, scale(self._behind, 1.0 / _AVERAGING_S))
            self._behind = add(self._behind, scale(change, tick.dt))
            error = norm(self._behind)
        else:
            self._behind, error = ZERO, 0.0
        if error <= limit:
            return setpoint
        reason = f"{error:.2f} m from its setpoint, {limit:g} m allowed"
        return Alarm("position_error_exceeded", Reaction.BRAKE, reason, error, limit, passes=True)

    def _settling_limit(self, limit: float, tick: Tick) -> float:
        """Return the limit of a vehicle that has not flown for long."""
        known = tick.known()
        height = known.position[2]
        if self._stood is None:
            self._stood = height
            if height_in_the_air(self._context, known, ()) > 0.0:
                self._settling = 0.0
        if height < self._stood + _LIFTED_HEIGHT:
            return limit
        self._settling -= tick.dt
        return _SETTLING_FACTOR * limit
