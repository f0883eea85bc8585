"""Models of the air: wind, gusts, eddies in a room, ground effect and downwash."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import exp, exp2, hypot, pi, sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add
from kybflow.drivers.sim.steps.onboard_state import Numbers
from kybflow.world.vehicle_context import Airframe

GUST_TIME = 1.0
"""Time constant of gusts, seconds."""
EDDY_TIME = 0.5
"""Time constant of eddies, seconds."""
AIR = 1.2
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
        """Return the values of the processes, `seconds` after the last call."""
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
    Aerospace Eng. 2017). Below z = R / 2, where the first term no longer holds, the gain is
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
        self._twice = 2.0 * AIR * 4.0 * pi * airframe.rotor_radius**2
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
