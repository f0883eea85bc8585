"""A PD controller in twenty lines.

    f = a_des + D (v_des - v) + K (p_des - p) + g e3

The attitude points body z along the specific force f, and the thrust is the mass times |f|. It has
no integral: a mass or a trim that isn't known leaves an error.
"""

from kybflow.core.geometry import GRAVITY, ZERO, from_thrust_direction, heading_of, norm
from kybflow.core.signals import Command, CommandKind, Setpoint, SetpointKind, Tick
from kybflow.core.units import Damping, Number
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import VehicleContext


@params
class MyTrackerParams:
    stiffness: Number = param("K, m/s^2 per metre.", default=9.0, above=0.0)
    damping: Damping = param("D.", default=5.0, above=0.0)


class MyTracker(Tracker[MyTrackerParams]):
    accepts = frozenset({SetpointKind.POSITION})
    emits = CommandKind.ATTITUDE_THRUST

    def __init__(self, params: MyTrackerParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._airframe = context.airframe

    @property
    def hover_thrust(self) -> float:
        return self._airframe.hover_thrust

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        k, d, now = self.params.stiffness, self.params.damping, tick.known()
        goal, speed = setpoint.position or ZERO, setpoint.velocity or ZERO
        x, y, z = (
            a + d * (v - u) + k * (s - p)
            for a, v, u, s, p in zip(
                setpoint.acceleration or ZERO, speed, now.velocity, goal, now.position, strict=True
            )
        )
        force, heading = (x, y, z + GRAVITY), heading_of(now.attitude)
        attitude = from_thrust_direction(force, setpoint.heading or heading)
        return Command(attitude, self._airframe.mass * norm(force), ZERO, heading)
