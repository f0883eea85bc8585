"""The session of vehicles simulated by rotorpy, in lockstep with the engine's clock.

Only this module imports rotorpy. rotorpy's own adaptive integrator is replaced by one step of the
classical Runge-Kutta method, which is as accurate over 2 ms and several times as fast. Its ground
is replaced too, since it holds down a vehicle that rises by less than a millimetre per step: here
the floor at z = 0 stops a vehicle that sinks into it, including its horizontal motion and its
rotation, and levels it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy
from scipy.integrate import OdeSolver

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    distance,
    from_heading,
    heading_of,
    rotate,
)
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.sensors import NOTHING, ImuErrors, imu_sample
from kybflow.drivers.sim.steps.onboard import (
    Numbers,
    OnboardState,
    control,
    estimate,
    shares,
    smooth,
)
from kybflow.drivers.sim.vehicle import TOUCH_GAP, SimulatedVehicle, jets_of, physics_rate
from kybflow.parts import Link, Seat, Session
from kybflow.parts.link import Touch
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random

try:
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor
except ImportError as missing:
    reason = "this driver needs rotorpy: pip install 'kybflow[rotorpy]'"
    raise DriverError(reason) from missing

HUMMINGBIRD: dict[str, Any] = quad_params
"""rotorpy's parameters of that airframe, SI units."""
MAX_ROTOR_SPEED = 1000.0
"""Speed at which a rotor produces its largest thrust, rad/s. The value is arbitrary, because
rotorpy's coefficients are scaled to it."""
ROTOR_DIRECTIONS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
"""Directions of the rotors along body x and y, in the order of `sim`."""
ROTOR_SENSES = (1.0, -1.0, 1.0, -1.0)
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
        self._thrust_per_square = sum(body.thrust) / 4.0 / MAX_ROTOR_SPEED**2
        told = self._parameters(context, body, aerodynamics)
        self._model = Multirotor(told, integrator_kwargs={"method": RungeKutta})
        w, x, y, z = from_heading(context.heading)
        self._state: dict[str, Any] = {
            "x": numpy.array(context.start), "v": numpy.zeros(3), "w": numpy.zeros(3),
            "q": numpy.array((x, y, z, w)), "wind": numpy.zeros(3),
            "rotor_speeds": numpy.zeros(4),
        }  # fmt: skip

    def _parameters(
        self, context: VehicleContext, body: BuiltAirframe, aerodynamics: float
    ) -> dict[str, Any]:
        """Return rotorpy's parameters of the vehicle. The coefficients of the rotors and the air
        are such that forces over mass at an airspeed are those of the Hummingbird in hover."""
        k, theirs = self._thrust_per_square, HUMMINGBIRD
        half, corners = context.airframe.arm / sqrt(2.0), enumerate(ROTOR_DIRECTIONS)
        heavier = aerodynamics * body.mass / theirs["mass"]
        hovers = sqrt(body.mass * GRAVITY / k)
        slower = sqrt(theirs["mass"] * GRAVITY / theirs["k_eta"]) / hovers
        return {
            "mass": body.mass,
            **dict(zip(("Ixx", "Iyy", "Izz"), body.inertia, strict=True)),
            **dict.fromkeys(("Ixy", "Ixz", "Iyz"), 0.0),
            "num_rotors": 4,
            "rotor_pos": {f"r{n}": numpy.array((half * x, half * y, 0.0)) for n, (x, y) in corners},
            "rotor_directions": numpy.array(ROTOR_SENSES),
            "k_eta": k,
            "k_m": context.airframe.torque_ratio * k,
            "tau_m": body.rotor_time,
            "rotor_speed_min": 0.0,
            "rotor_speed_max": 1.5 * MAX_ROTOR_SPEED,
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
            raise DriverError(f"rotorpy failed: {error}") from error
        self._state = state
        if any(more):
            state["v"] = state["v"] + dt / self._model.mass * numpy.array(more[:3])
            state["w"] = state["w"] + dt * (self._model.inv_inertia @ numpy.array(more[3:]))
        if self.is_down and state["v"][2] <= 0.0:
            w, x, y, z = from_heading(heading_of(self.truth.attitude))
            state["x"][2] = 0.0
            state["v"], state["w"] = numpy.zeros(3), numpy.zeros(3)
            state["q"] = numpy.array((x, y, z, w))
        return _vector((state["v"] - before) / dt)


def _vector(array: Any) -> Vec3:
    x, y, z = array.tolist()
    return (x, y, z)


class RotorpyWorld(Session):
    """All vehicles, each with its own plant. Raises DriverError if their physics rates differ."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        self._rate = physics_rate(seats)
        self._dt = 1.0 / self._rate
        self.onboard = OnboardState(len(seats), lambda count, width: [(0.0,) * width] * count)
        self._seats = [seat.context for seat in seats]
        self._vehicles = [
            SimulatedVehicle(self, i, seat, generator) for i, seat in enumerate(seats)
        ]
        self._plants = [
            Plant(seat.context, vehicle.body, seat.params.aerodynamics)
            for seat, vehicle in zip(seats, self._vehicles, strict=True)
        ]
        self.links: dict[str, Link] = {
            context.vehicle: vehicle
            for context, vehicle in zip(self._seats, self._vehicles, strict=True)
        }
        sources = [vehicle.imu_source for vehicle in self._vehicles]
        self._errors = ImuErrors(sources, numpy.ndarray.tolist)
        self._shares = shares(self._dt)
        self._touched: dict[tuple[int, Touch], Time] = {}
        self._blown: Time = 0
        for vehicle in self._vehicles:
            vehicle.measure(0)

    @property
    def now(self) -> Time:
        """The time of the last physics step."""
        return self.onboard.steps * NS // self._rate

    def advance(self, now: Time) -> None:
        last = ((now + 1) * self._rate - 1) // NS
        if self.onboard.steps >= last:
            return
        self._blow(now)
        while self.onboard.steps < last:
            self._step()
        for index, vehicle in enumerate(self._vehicles):
            for touch in self._touches(index):
                before = self._touched.get((index, touch))
                self._touched[index, touch] = now
                if before is None or now - before > TOUCH_GAP:
                    vehicle.on_touch(touch)

    def _step(self) -> None:
        on, row = self.onboard, self._errors.take(1)
        for i, (vehicle, plant) in enumerate(zip(self._vehicles, self._plants, strict=True)):
            before, most = plant.truth, on.thrusts[i]
            asked = tuple(u * f for u, f in zip(on.controls[i], most, strict=True))
            moved = plant.step(asked, on.winds[i], on.pushes[i], self._dt)
            on.rotors[i] = tuple(
                given / f if f else 0.0 for given, f in zip(plant.thrusts, most, strict=True)
            )
            velocity = (*before.velocity, *before.angular_velocity)
            felt = imu_sample(_rows(before.attitude), velocity, moved, self._errors.block[row][i])
            on.filters[i], rates = estimate(on.filters[i], on.setpoints[i], felt, self._shares)
            on.gyros[i], rates = smooth(on.gyros[i], rates)
            on.loops[i], wanted = control(
                on.loops[i], on.filters[i], rates, on.setpoints[i], on.gains[i]
            )
            on.controls[i] = on.delayed(i, wanted)
            if vehicle.reads_imu:
                vehicle.add_imu(felt)
        on.steps += 1
        for vehicle in self._vehicles:
            if vehicle.due <= self.now:
                vehicle.measure(self.now)

    def _blow(self, now: Time) -> None:
        """Set the wind (world frame), the additional force and torque, and the vibration of each
        vehicle."""
        elapsed, self._blown = (now - self._blown) / NS, now
        jets = jets_of(self._vehicles)
        for i, vehicle in enumerate(self._vehicles):
            if vehicle.is_disturbed:
                self.onboard.winds[i] = vehicle.wind_at(now, elapsed, jets)
                thrust = vehicle.thrust
                self.onboard.pushes[i] = vehicle.push(elapsed, thrust)
                self._errors.shake(i, vehicle.vibration(thrust))

    def _touches(self, index: int) -> Iterator[Touch]:
        """Yield what a vehicle touches now: the floor, and obstacles and vehicles within its arms'
        reach."""
        context, plant = self._seats[index], self._plants[index]
        place, arm = plant.truth.position, context.airframe.arm
        if plant.is_down:
            yield Touch("the floor", carries=True)
        for name, shape in context.obstacles.items():
            if shape.distance(place) < arm:
                yield Touch(name, carries=False)
        for other, beside in enumerate(self._seats):
            there = self._plants[other].truth.position
            if other != index and distance(there, place) < arm + beside.airframe.arm:
                yield Touch(beside.vehicle, carries=False)

    def truth(self, index: int) -> Truth:
        """Return the current state of a vehicle."""
        return self._plants[index].truth

    def index(self, name: str) -> int:
        """Return the index of a vehicle."""
        return list(self.links).index(name)

    def apply_faults(self, index: int) -> None:
        """Apply a vehicle's active faults."""
        vehicle = self._vehicles[index]
        self._plants[index].load(vehicle.body.mass * vehicle.faults.mass + vehicle.faults.payload)
        self._errors.bias(index, vehicle.imu_bias)
        self.onboard.winds[index], self.onboard.pushes[index] = ZERO, NOTHING

    def grip(self, index: int, is_open: bool, armed: bool) -> bool:
        """Raise Refused, since no vehicle carries a payload."""
        raise Refused("it carries no payload")

    def schedule(self, due: Time) -> None:
        """Do nothing: every step checks which measurements are due."""

    def update_imu_readers(self) -> None:
        """Do nothing: every step checks `reads_imu` of each vehicle."""

    def close(self) -> None:
        """There is nothing to release."""


def _rows(attitude: Quat) -> Numbers:
    """Return the rotation from body to world, row by row."""
    columns = [rotate(attitude, axis) for axis in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))]
    return tuple(column[row] for row in range(3) for column in columns)
