"""Keep away from obstacles and other vehicles, and fly around them.

A control-barrier filter (Wang, Ames, Egerstedt: Safety Barrier Certificates for Collisions-Free
Multirobot Systems, T-RO 2017) changes the acceleration of the setpoint as little as keeps `keep`
between the hulls, with a deceleration of `braking`; solved exactly, as a small quadratic program.
The rules are in `kybflow.flight.avoidance`, `barrier` and `following`. A setpoint that needs no
change passes bit for bit; a vehicle that was held back catches up at up to `speed`. A vehicle whose
path is blocked turns to the right until it can go on: two that meet head on pass each other, and
several that meet at one point circle it in the same direction, so that none waits for long. List it
after `limit_speed` and `limit_acceleration`, which would otherwise limit its evasions.

It keeps away from all other vehicles, by their estimates, or only from those in
`treat_as_obstacles`: in a formation, those that have left it. It doesn't rely on others to give
way. If no path is left, it brakes, yields to the strongest demand, and emits `avoidance_blocked`.
It acts in behaviors that stay in the air. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.events import Emitting
from kybflow.core.signals import Setpoint, Tick
from kybflow.core.units import Acceleration, Length, Speed
from kybflow.flight.avoidance.following import ACCEPTS, Avoidance, AvoidanceBlocked, Detour, Keeping
from kybflow.flight.avoidance.surroundings import Nearby
from kybflow.parts import Objection, Processor, param, params
from kybflow.world.vehicle_context import Airframe, VehicleContext

_USUAL_DEVIATION = 0.02
"""Usual deviation of a vehicle from its setpoint, m."""
_CLOSER_SHARE = 0.5
"""The fraction of `keep` by which the vehicle itself may come closer than its setpoint."""


@params
class AvoidObstaclesParams:
    keep: Length = param(
        "Distance between the rotor tips and anything else.", default=0.2, above=0.0, room="across"
    )
    treat_as_obstacles: tuple[str, ...] | None = param(
        "The vehicles to keep away from; by default all others.",
        default=None,
        names="vehicle",
    )
    braking: Acceleration = param(
        "Deceleration of planned stops.", default=1.0, at_least=0.2, at_most=2.0
    )
    speed: Speed = param(
        "Largest speed of catching up with the original setpoint.", default=0.8, above=0.0
    )


class AvoidObstacles(Processor[AvoidObstaclesParams]):
    accepts = ACCEPTS
    goes_round = True
    evades = True
    own_events = (AvoidanceBlocked,)

    @classmethod
    def keeps_off(cls, params: AvoidObstaclesParams, airframe: Airframe) -> float:
        return airframe.hull + params.keep

    @classmethod
    def objections(
        cls, params: AvoidObstaclesParams, context: VehicleContext
    ) -> Iterator[Objection]:
        if params.keep < _USUAL_DEVIATION:
            reason = "is less than the usual tracking error"
            yield Objection("keep", reason, f"keep {_USUAL_DEVIATION:g} m or more", is_doubt=True)

    def __init__(self, params: AvoidObstaclesParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._nearby = Nearby(context, params.treat_as_obstacles)
        self._avoidance = Avoidance(context.airframe, self._nearby, Detour(context.fence))

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Emitting:
        p = self.params
        if p.treat_as_obstacles is not self._nearby.others:
            self._nearby.count(p.treat_as_obstacles)
        keeping = Keeping(p.keep, _CLOSER_SHARE * p.keep, p.braking, p.speed)
        return self._avoidance.bend(setpoint, tick, keeping)
