"""How a vehicle differs from its airframe, and the disturbances of its lab, drawn once per flight.

The air is modelled as wind, gusts, eddies in a room, ground effect and downwash.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import exp, exp2, hypot, pi, sqrt
from typing import Any, NamedTuple

from kybflow.core.geometry import LEVEL, Quat, Vec3, add, integrate
from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.sensors import Array, bias, draw, vibrations
from kybflow.drivers.sim.steps.onboard import Loop, Numbers
from kybflow.world.vehicle_context import Airframe

GUST_TIME = 1.0
"""Time constant of gusts, seconds."""
EDDY_TIME = 0.5
"""Time constant of eddies, seconds."""
AIR_DENSITY = 1.2
"""Density of air, kg/m^3."""
FOUNTAIN = 4.0
"""Coefficient of the lift on the body by the air that rises between the rotors: twice the value K
of the authors named in `GroundEffect`."""


class Wandering:
    """Ornstein-Uhlenbeck processes with a time constant of `lasts` seconds. deviations: the
    standard deviation of each process. noise: rows of standard normal numbers, one number per
    process."""

    def __init__(
        self, deviations: Sequence[float], lasts: float, noise: Iterator[list[float]]
    ) -> None:
        self._deviations, self._lasts, self._noise = deviations, lasts, noise
        self._now: Numbers = (0.0,) * len(deviations)

    def after(self, seconds: float) -> Numbers:
        """Advance the random processes by `seconds`, and return their values."""
        keep = exp(-seconds / self._lasts)
        kick = sqrt(1.0 - keep * keep)
        moved = zip(self._now, self._deviations, next(self._noise), strict=True)
        self._now = tuple([keep * x + spread * kick * n for x, spread, n in moved])
        return self._now


class GustyWind:
    """The wind at one vehicle, m/s, world frame: a steady wind plus gusts along each axis. gust:
    standard deviation of the gusts. noise: rows of three standard normal numbers."""

    def __init__(self, steady: Vec3, gust: float, noise: Iterator[list[float]]) -> None:
        self._steady = steady
        self._gusts = Wandering((gust, gust, gust), GUST_TIME, noise) if gust else None
        self.blows = gust > 0.0 or any(steady)

    def after(self, seconds: float) -> Vec3:
        """Return the wind, `seconds` after the last call."""
        if self._gusts is None:
            return self._steady
        x, y, z = self._gusts.after(seconds)
        return add(self._steady, (x, y, z))


class GroundEffect:
    """The thrust that rotors gain over a floor:

        T / T0 = 1 / (1 - (R / 4z)^2 - R^2 z (d^2 + 4 z^2)^-1.5 - k R^2 z (b^2 + 4 z^2)^-1.5)

    z: height of the rotors over the floor. R: radius of the rotors. d, b: distances of neighbouring
    and of opposite hubs. k: 1/2 for the rotor across plus `FOUNTAIN` for the body. The first term
    is Cheeseman and Bennett's (ARC R&M 3021, 1955), the others are those of a quadrotor by
    Sanchez-Cuevas, Heredia and Ollero (Characterization of the Aerodynamic Ground Effect, Int. J.
    Aerospace Eng. 2017). Below z = R / 2, where the first term is no longer valid, the gain is
    constant. Only the world's floor counts, not obstacles below a vehicle. share: a factor on the
    gain.
    """

    def __init__(self, airframe: Airframe, share: float) -> None:
        self._radius, self._diameter = airframe.rotor_radius, airframe.diameter
        self._share = share

    def gain(self, height: float) -> float:
        """Return the gain at a height, m, as a fraction of the thrust far from the floor."""
        z, across = max(height, 0.5 * self._radius), self._diameter**2
        area, far = self._radius**2, 4.0 * z * z
        beside, opposite = sqrt(0.5 * across + far) ** 3, sqrt(across + far) ** 3
        lost = 0.25 * area / far + area * z * (1.0 / beside + (0.5 + FOUNTAIN) / opposite)
        return self._share * lost / (1.0 - lost)


class Downwash:
    """The turbulent jet into which the flows of a vehicle's rotors merge. Its speed w is

        w = 10.1 v / s 2^-(r / h)^2,    h = 0.0767 s,    s = 5.82 + depth / diameter

    v = sqrt(T / (2 A rho)): the speed that rotors of the area A induce at the thrust T. r: the
    horizontal distance over the diameter. Bauersfeld, Muller, Ziegler, Coletti and Scaramuzza
    (Robotics meets Fluid Dynamics, RA-L 2025) measured the jet below six quadrotors, from 2.5
    diameters on; nearer to the vehicle, where it reaches 1.7 v, it is extrapolated. This Gaussian
    is as wide as their profile. The jet points straight down: neither wind nor tilt bends it.
    share: a factor on the speed.
    """

    def __init__(self, airframe: Airframe, share: float) -> None:
        self._twice = 2.0 * AIR_DENSITY * 4.0 * pi * airframe.rotor_radius**2
        self._diameter, self._share = airframe.diameter, share

    def jet(self, at: Vec3, thrust: float) -> Jet:
        """Return the jet below a vehicle at a position with a thrust, N."""
        return Jet(at, self._diameter, self._share * sqrt(thrust / self._twice))


class Jet(NamedTuple):
    """The jet below a vehicle. at: position of the vehicle. diameter: of the vehicle's airframe,
    metres. speed: v of `Downwash`, m/s."""

    at: Vec3
    diameter: float
    speed: float

    def sinks(self, place: Vec3) -> float:
        """Return the speed at which the air sinks at a position, m/s."""
        x, y, z = self.at
        px, py, pz = place
        if pz >= z:
            return 0.0
        away = 5.817 + (z - pz) / self.diameter
        aside = hypot(px - x, py - y) / (0.07668 * away * self.diameter)
        return 10.11 * self.speed / away * exp2(-aside * aside)


_NOUGHT = dict.fromkeys(
    (
        "force_noise", "torque_noise", "drag_error", "accelerometer_vibration", "gyro_vibration",
        "ground_effect", "downwash", "inflow", "loop_error", "gyro_filter", "dead_time",
        "command_latency", "command_jitter", "mocap_misalignment", "mocap_loss", "stamp_error",
        "stamp_jitter",
    ),
    0.0,
)  # fmt: skip

ROTOR_SPREAD = 0.2
"""Largest difference of a rotor's thrust from the mean, as a fraction of `model_error`."""
LATERAL_VIBRATION = 0.6
"""The accelerometer's vibration along body x and y, relative to that along z."""


class Lab(NamedTuple):
    """The lab of one vehicle. drag: factor on the body's drag. inflow: drag along body z relative
    to that in the rotors' plane. loop: settings of the on-board loop. eddies: force (N, world
    frame) and torque (N m, body frame); None in still air. vibration: of the IMU in hover; None
    without vibration. ground, downwash: the models of both effects; None without. markers: attitude
    of the motion-capture body relative to the vehicle's. stamps: error of the poses' time stamps,
    s. late: delay of each command, s; None without delay."""

    drag: float
    inflow: float
    loop: Loop
    eddies: Wandering | None
    vibration: Iterator[Array] | None
    ground: GroundEffect | None
    downwash: Downwash | None
    markers: Quat
    stamps: float
    late: Iterator[list[float]] | None

    @property
    def disturbs(self) -> bool:
        """Whether any disturbance changes over time."""
        found = (self.eddies, self.vibration, self.ground, self.downwash)
        return any(disturbs is not None for disturbs in found)


def as_flown(params: Any) -> Any:
    """Return the parameters, with all disturbances set to zero if `calm`."""
    return replace(params, **_NOUGHT) if params.calm else params


def lab(p: Any, airframe: Airframe, body: BuiltAirframe, generator: Any) -> Lab:
    """Draw the random lab of a vehicle. p: the vehicle's parameters from `as_flown`. body: the
    vehicle as built."""
    drag, jx, jy, jz, lag, stamps = generator.uniform(-1.0, 1.0, 6).tolist()
    wrong = p.loop_error
    ix, iy, iz = airframe.inertia
    believed = replace(
        airframe,
        inertia=(ix * (1.0 + wrong * jx), iy * (1.0 + wrong * jy), iz * (1.0 + wrong * jz)),
        rotor_time=airframe.rotor_time * (1.0 + wrong * lag),
    )
    turned = bias(generator, p.mocap_misalignment)
    eddies, commands, rotors = generator.spawn(3)
    spread = [body.mass * p.force_noise] * 3 + [j * p.torque_noise for j in body.inertia]
    noise = draw(eddies, [0.0] * 6, [1.0] * 6)
    gyro, along = p.gyro_vibration, p.accelerometer_vibration
    shaking = [gyro, gyro, gyro, LATERAL_VIBRATION * along, LATERAL_VIBRATION * along, along]
    latency, jitter = p.command_latency, p.command_jitter
    return Lab(
        1.0 + p.drag_error * drag,
        p.inflow,
        Loop(believed, p.gyro_filter, p.dead_time),
        Wandering(spread, EDDY_TIME, noise) if any(spread) else None,
        vibrations(rotors, shaking) if any(shaking) else None,
        GroundEffect(airframe, p.ground_effect) if p.ground_effect else None,
        Downwash(airframe, p.downwash) if p.downwash else None,
        integrate(LEVEL, turned, 1.0),
        p.stamp_error * stamps,
        draw(commands, [latency], [jitter]) if latency or jitter else None,
    )


def build(airframe: Airframe, error: float, generator: Any) -> BuiltAirframe:
    """Draw a random vehicle that differs from its airframe by at most the fraction `error`; its
    rotors differ a little from each other. The inertia follows from the mass distribution drawn
    along each axis, since three independently drawn moments may be physically impossible."""
    draws = (1.0 + error * generator.uniform(-1.0, 1.0, 7)).tolist()
    mass, along_x, along_y, along_z, thrust, rotor_time, drag = draws
    half = sum(airframe.inertia) / 2.0
    xx, yy, zz = (
        max(0.0, half - moment) * factor
        for moment, factor in zip(airframe.inertia, (along_x, along_y, along_z), strict=True)
    )
    spread = 1.0 + error * ROTOR_SPREAD * generator.uniform(-1.0, 1.0, 4)
    a, b, c, d = (airframe.thrust * thrust * spread).tolist()
    return BuiltAirframe(
        airframe.mass * mass, (yy + zz, zz + xx, xx + yy), (a, b, c, d),
        airframe.rotor_time * rotor_time, airframe.drag * drag,
    )  # fmt: skip
