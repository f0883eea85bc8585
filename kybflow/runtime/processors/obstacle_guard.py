"""Stop before the world's obstacles and objects, whatever the behavior requests.

Every vehicle has it unless its mission lists its own processors (`library/defaults.yaml`). The
setpoint brakes with `braking`, so that the rotors stay `keep` away from each obstacle: if it heads
for an obstacle it brakes along its path, and if it passes one it slides along it. A setpoint that
is too close is led back, at up to 0.3 m/s. The rules are in `kybflow.flight.avoidance`, `barrier`
and `following`. A setpoint that keeps clear by itself passes unchanged, bit for bit. If the demands
of several obstacles contradict each other, it brakes and emits `avoidance_blocked`.

It does not fly around obstacles, and ignores other vehicles: `avoid_obstacles` does both. It acts
in behaviors that stay in the air, not in take-off and landing, which come close to the surface that
they leave or land on. An obstacle that may be touched has `contact: allowed` in the world; an
object may be touched by a behavior that means to. Metres, world frame.
"""

from __future__ import annotations

from kybflow.core.events import Emitting
from kybflow.core.signals import Setpoint, Tick
from kybflow.core.units import Acceleration, Length, Speed
from kybflow.flight.avoidance.following import ACCEPTS, Avoidance, AvoidanceBlocked, Keeping
from kybflow.flight.avoidance.surroundings import Nearby
from kybflow.parts import Processor, param, params
from kybflow.world.vehicle_context import Airframe, VehicleContext


@params
class ObstacleGuardParams:
    keep: Length = param(
        "Distance between the rotor tips and obstacles.",
        default=0.1, at_least=0.0, tightens="up", room="across",
    )  # fmt: skip
    braking: Acceleration = param(
        "Deceleration of planned stops.", default=2.0, at_least=0.2, at_most=2.0
    )
    speed: Speed = param(
        "Largest speed of catching up with the original setpoint.", default=1.0, above=0.0
    )


class ObstacleGuard(Processor[ObstacleGuardParams]):
    accepts = ACCEPTS
    clamps = True
    own_events = (AvoidanceBlocked,)

    @classmethod
    def keeps_off(cls, params: ObstacleGuardParams, airframe: Airframe) -> float:
        return airframe.hull + params.keep

    def __init__(self, params: ObstacleGuardParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        nearby = Nearby(context, others=())
        self.idle = nearby.is_empty
        self._avoidance = Avoidance(context.airframe, nearby)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Emitting:
        p = self.params
        return self._avoidance.bend(setpoint, tick, Keeping(p.keep, p.keep, p.braking, p.speed))
