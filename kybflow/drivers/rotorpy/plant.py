"""One vehicle simulated by rotorpy; the only module that imports rotorpy.

rotorpy's own adaptive integrator is replaced by one step of the classical Runge-Kutta method, which
is as accurate over 2 ms and several times as fast. Its ground is replaced too, since it holds down
a vehicle that rises by less than a millimetre per step: here the floor at z = 0 stops a vehicle
that sinks into it, including its horizontal motion and its rotation, and levels it.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy
from scipy.integrate import OdeSolver

from kybflow.core.errors import DriverError
from kybflow.core.geometry import GRAVITY, Vec3, from_heading, heading_of
from kybflow.core.signals import Truth
from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.steps.onboard_state import Numbers
from kybflow.world.vehicle_context import VehicleContext

try:
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor
except ImportError as missing:
    reason = "this driver needs rotorpy: pip install 'kybflow[rotorpy]'"
    raise DriverError(reason) from missing

HUMMINGBIRD: dict[str, Any] = quad_params
"""rotorpy's parameters of that airframe, SI units."""
FASTEST = 1000.0
"""Speed at which a rotor produces its largest thrust, rad/s. The value is arbitrary, because
rotorpy's coefficients are scaled to it."""
CORNERS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
"""Directions of the rotors along body x and y, in the order of `sim`."""
TURNING = (1.0, -1.0, 1.0, -1.0)
"""The sign of each rotor's drag torque about body z."""


class RungeKutta(OdeSolver):  # type: ignore[misc]  # scipy has no types
    """The classical Runge-Kutta method, in one step."""

    def __init__(self, fun: Any, t0: float, y0: Any, t_bound: float, vectorized: bool) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self.t: float
        self.y: Any

    def _step_impl(self) -> tuple[bool, None]:
        f, t, y, h = self.fun, self.t, self.y, self.t_bound - self.t
        a = f(t, y)
        b = f(t + 0.5 * h, y + 0.5 * h * a)
        c = f(t + 0.5 * h, y + 0.5 * h * b)
        d = f(t + h, y + h * c)
        self.t, self.y = self.t_bound, y + h / 6.0 * (a + 2.0 * (b + c) + d)
        return True, None


class Plant:
    """A vehicle's body and rotors. aerodynamics: factor on the aerodynamic forces of the
    Hummingbird."""

    def __init__(self, context: VehicleContext, body: BuiltAirframe, aerodynamics: float) -> None:
        self._thrust_per_square = sum(body.thrust) / 4.0 / FASTEST**2
        told = {**_frame(context, body), **self._rotors(context, body, aerodynamics)}
        self._inertia = body.inertia
        self._model = Multirotor(told, integrator_kwargs={"method": RungeKutta})
        w, x, y, z = from_heading(context.heading)
        self._state: dict[str, Any] = {
            "x": numpy.array(context.start), "v": numpy.zeros(3), "w": numpy.zeros(3),
            "q": numpy.array((x, y, z, w)), "wind": numpy.zeros(3),
            "rotor_speeds": numpy.zeros(4),
        }  # fmt: skip

    def _rotors(
        self, context: VehicleContext, body: BuiltAirframe, aerodynamics: float
    ) -> dict[str, Any]:
        """Return the coefficients of the rotors and the air, such that forces over mass at an
        airspeed are those of the Hummingbird in hover."""
        k, theirs = self._thrust_per_square, HUMMINGBIRD
        heavier = aerodynamics * body.mass / theirs["mass"]
        hovers = sqrt(body.mass * GRAVITY / k)
        slower = sqrt(theirs["mass"] * GRAVITY / theirs["k_eta"]) / hovers
        return {
            "k_eta": k,
            "k_m": context.airframe.torque_ratio * k,
            "tau_m": body.rotor_time,
            "rotor_speed_min": 0.0,
            "rotor_speed_max": 1.5 * FASTEST,
            **{name: theirs[name] * heavier * slower for name in ("k_d", "k_z")},
            **{name: theirs[name] * heavier for name in ("k_h", "c_Dx", "c_Dy", "c_Dz")},
        }

    @property
    def truth(self) -> Truth:
        """The current state."""
        s = self._state
        qx, qy, qz, qw = s["q"].tolist()
        return Truth(_vector(s["x"]), _vector(s["v"]), (qw, qx, qy, qz), _vector(s["w"]))

    @property
    def thrusts(self) -> Numbers:
        """The current thrust of each rotor, N."""
        return tuple((self._thrust_per_square * self._state["rotor_speeds"] ** 2).tolist())

    @property
    def is_down(self) -> bool:
        """Whether the vehicle stands on the floor."""
        return bool(self._state["x"][2] <= 0.0)

    def load(self, mass: float) -> None:
        """Set the mass, kg, from now on; the radii of gyration stay the same."""
        model, share = self._model, mass / self._model.mass
        model.mass = mass
        model.inertia = model.inertia * share
        model.inv_inertia = model.inv_inertia / share
        model.weight = model.weight * share

    def step(self, thrusts: Numbers, wind: Vec3, more: Numbers, dt: float) -> Vec3:
        """Advance by `dt` seconds. Return the mean acceleration, world frame, m/s^2. thrusts: the
        commanded thrust of each rotor, N. wind: world frame, m/s. more: additional force (N, world
        frame) and torque (N m, body frame). Raises DriverError if rotorpy finds no solution, for
        instance because a body spins so fast that numbers overflow."""
        state, k = self._state, self._thrust_per_square
        state["wind"] = numpy.array(wind)
        before = state["v"]
        speeds = numpy.sqrt(numpy.maximum(thrusts, 0.0) / k)
        try:
            with numpy.errstate(over="raise", invalid="raise"):
                state = self._model.step(state, {"cmd_motor_speeds": speeds}, dt)
        except (ArithmeticError, ValueError) as error:
            raise DriverError(f"rotorpy can't go on: {error}") from error
        self._state = state
        if any(more):
            state["v"] = state["v"] + dt / self._model.mass * numpy.array(more[:3])
            state["w"] = state["w"] + dt * (self._model.inv_inertia @ numpy.array(more[3:]))
        if self.is_down and state["v"][2] <= 0.0:
            self._stand()
        return _vector((state["v"] - before) / dt)

    def _stand(self) -> None:
        heading = heading_of(self.truth.attitude)
        w, x, y, z = from_heading(heading)
        state = self._state
        state["x"][2] = 0.0
        state["v"], state["w"] = numpy.zeros(3), numpy.zeros(3)
        state["q"] = numpy.array((x, y, z, w))


def _frame(context: VehicleContext, body: BuiltAirframe) -> dict[str, Any]:
    half, (jx, jy, jz) = context.airframe.arm / sqrt(2.0), body.inertia
    corners = enumerate(CORNERS)
    return {
        "mass": body.mass,
        **dict(zip(("Ixx", "Iyy", "Izz"), (jx, jy, jz), strict=True)),
        **dict.fromkeys(("Ixy", "Ixz", "Iyz"), 0.0),
        "num_rotors": 4,
        "rotor_pos": {f"r{n}": numpy.array((half * x, half * y, 0.0)) for n, (x, y) in corners},
        "rotor_directions": numpy.array(TURNING),
    }


def _vector(array: Any) -> Vec3:
    x, y, z = array.tolist()
    return (x, y, z)
