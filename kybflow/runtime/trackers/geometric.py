"""Geometric position control on SE(3), which feeds the jerk forward, for an on-board attitude loop.

Lee, Leok and McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, in two
halves: the force and its direction here, the attitude error on board. With e = p - p_des and
e' = v - v_des, world frame, the wanted specific force is

    f = a_des + g e3 - P e - D e' - I integral(e) + c (v_des - (v_des . z) z)

where the last two terms are as in `cascade`: the integral is horizontal, and c compensates the
rotors' drag, which acts in the rotor plane (z: the body's z axis). Thrust is the mass times f along
the estimated body z; the commanded attitude has its z axis along f. The commanded body rates are
the rates at which that attitude turns, from

    f' = j_des - P e' - D e'' + c a_des,       e'' = a - a_des

where a is the acceleration due to the last thrust along the estimated body z, minus drag and g. So
both the jerk and the feedback turn the vehicle; in `cascade` only the jerk does. About body z it
turns with the heading rate. A VELOCITY setpoint has no P and I terms.

P, D and I follow from the on-board loop and its delays (`kybflow.flight.loops.position_loop`) if
they are not given: 16, 9 and 8 on a fast one, and lower ones that don't oscillate on a slow one.
They are also lower for late or uncertain estimates, such as from a camera at 15 Hz or GPS.

Errors on the figure eight in still air, without an observer (width 1.46 m, two laps after 3 s of
hovering; mean and largest over ten seeds, position in cm, velocity in cm/s):

    airframe   lap    cascade                     geometric
    mk_quadro  10 s   0.21, 0.40   0.32, 0.83     0.12, 0.26   0.27, 0.79
               7 s    0.30, 0.56   0.45, 1.20     0.18, 0.36   0.32, 0.85
               5 s    0.40, 0.73   0.69, 1.69     0.24, 0.47   0.40, 1.05
               4 s    0.50, 1.42   1.61, 5.81     0.37, 1.10   1.23, 5.94
    nano_plus  10 s   0.21, 0.41   0.30, 0.94     0.13, 0.27   0.27, 0.79
               7 s    0.31, 0.58   0.44, 1.07     0.19, 0.38   0.31, 0.83
               5 s    0.41, 0.76   0.73, 1.83     0.26, 0.49   0.40, 1.21
               4 s    0.52, 1.76   1.61, 6.68     0.46, 1.49   1.42, 7.32

A lap of 4 s needs the airframes' whole tilt. With the gains of this one `cascade` comes as near
(0.13, 0.27 cm at 10 s), but shakes: 0.39, 1.28 cm/s.

With `observer` the disturbance is estimated from the accelerometer and subtracted from f
(`kybflow.flight.force_estimates`). The figure eight with a lap of 10 s in the simulator's lab, an
assumed mass of 80 and of 120 %, mean and largest position error in mm, without it over seeds 0 to 9
and with it over seeds 0 to 19; the largest of any flight in brackets:

    airframe   without                     2 Hz
    mk_quadro  10.3 (12.5), 24.2 (31.7)    4.8 (6.2), 15.7 (21.9)
    nano_plus  11.7 (14.7), 23.4 (27.6)    3.2 (3.8),  6.8 (8.0)

Limits, mass and the trim against the on-board attitude's error: `kybflow.flight.steering`.
"""

from __future__ import annotations

from kybflow.core.signals import Command, CommandKind, MeasurementKind, Setpoint, SetpointKind, Tick
from kybflow.flight.geometric_law import GeometricLaw, GeometricParams, outer_loop, used_by
from kybflow.flight.loops.position_loop import OuterLoop
from kybflow.parts import Tracker
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext


class Geometric(Tracker[GeometricParams]):
    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY})
    emits = CommandKind.ATTITUDE_THRUST

    def __init__(self, params: GeometricParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._law = GeometricLaw(params, context)

    @classmethod
    def uses(cls, params: GeometricParams) -> frozenset[MeasurementKind]:
        return used_by(params)

    @classmethod
    def outer_loop(
        cls, params: GeometricParams, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop:
        return outer_loop(params, airframe, inner, period)

    @property
    def hover_thrust(self) -> float:
        return self._law.hover_thrust

    @property
    def lean(self) -> tuple[float, float]:
        return self._law.lean

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        return self._law.command(self.params, setpoint, tick)
