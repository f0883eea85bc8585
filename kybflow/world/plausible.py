"""Checks whether an airframe's numbers are those of a quadrotor, by their ratios.

The references are the airframes of the library, those of RotorPy (both Crazyflies and the
Hummingbird), RotorS's Hummingbird, and RotorPy's copy of the quadrotor in PX4's SIH simulation:

    thrust to weight     1.7 to 10.2
    disc loading         m g / 4 pi r^2, N/m^2: 51 to 108
    radius of gyration   sqrt(I / m) over the diameter: 0.20 to 0.47 about x and y, 0.27 to 0.51
                         about z; with all of the mass at the hubs 0.35 and 0.5
    torque ratio         over the rotor's radius, C_Q / C_T: 0.12 to 1.6
    drag                 0.12 to 0.45 1/s
    rotor time           5 to 72 ms; 107 ms without a speed loop (hector_quadrotor)

The bounds of usual and of possible values leave a margin to these. SI units; r is a quarter of the
diameter.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sqrt
from typing import NamedTuple

from kybflow.core.units import DAMPING, DURATION, LENGTH, MASS, Dimension, format_quantity
from kybflow.world.vehicle_context import Airframe, Parcel


class Range(NamedTuple):
    """The usual range of a value, `low` to `high`, and the possible range, `least` to `most`."""

    least: float
    low: float
    high: float
    most: float

    def has(self, value: float, is_certain: bool) -> bool:
        low, high = (self.least, self.most) if is_certain else (self.low, self.high)
        return low <= value <= high


class Implausible(NamedTuple):
    """An implausible value. parameters: the parameters that determine it, the one most likely to be
    wrong first. found: a description of the value. usual: a description of usual values.
    is_certain: whether the value is impossible, not only unusual."""

    parameters: tuple[str, ...]
    found: str
    usual: str
    is_certain: bool


_LOADING = Range(1.0, 10.0, 600.0, 4000.0)
"""Disc loading, N/m^2."""
_GYRATION = Range(0.04, 0.1, 0.55, 0.75)
_TORQUE = Range(0.005, 0.03, 2.0, 10.0)
_ROTOR_TIME = Range(0.0005, 0.004, 0.15, 0.4)
_DRAG = Range(0.0, 0.0, 2.0, 10.0)
_WEAK, _MAX_RATIO = 1.5, 15.0
"""Thrust to weight: less than the smallest reference, because an airframe with 1.3 has too little
left for control when its battery sags; and 1.5 times the largest."""
_ENDURANCE = Range(0.0, 30.0, 7200.0, 86400.0)
_BUMPER = Range(0.67, 0.9, 2.0, 5.0)
"""Radius of a bumper over that of the rotors' tips: 0.96 for the AR.Drone's hull. The hubs are at
0.67."""
_DENSITY = Range(0.0, 2.0, 12000.0, 23000.0)
"""Density of a payload, kg/m^3. Lead has 11,300; osmium, the densest metal, has 22,600."""


def of_airframe(airframe: Airframe) -> Iterator[Implausible]:
    """Yield the implausible values of an airframe. The airframe must be able to lift itself."""
    radius, diameter, mass = airframe.rotor_radius, airframe.diameter, airframe.mass
    loading = airframe.hover_thrust / (4.0 * pi * radius**2)
    if not _LOADING.has(loading, False):
        found = f"{loading:.3g} N carried by each m^2 below its rotors"
        usual = f"{_LOADING.low:g} to {_LOADING.high:g} N/m^2 with rotors of a quarter its diameter"
        yield Implausible(("diameter", "mass"), found, usual, not _LOADING.has(loading, True))
    if _LOADING.has(loading, True):
        for moment in dict.fromkeys(airframe.inertia):
            share = sqrt(moment / mass) / diameter
            if moment > 0.0 and not _GYRATION.has(share, False):
                low, high = (mass * (of * diameter) ** 2 for of in _GYRATION[1:3])
                found = f"a moment of inertia of {moment:.3g} kg m^2"
                usual = f"{low:.2g} to {high:.2g} kg m^2 for its mass and diameter"
                yield Implausible(("inertia",), found, usual, not _GYRATION.has(share, True))
                break
    ratio = airframe.torque_ratio
    if not _TORQUE.has(ratio / radius, False):
        low, high = (share * radius for share in _TORQUE[1:3])
        found = f"a torque of {format_quantity(ratio, LENGTH)} per newton"
        usual = f"{low * 100:.2g} to {high * 100:.2g} cm for its rotors"
        is_certain = not _TORQUE.has(ratio / radius, True)
        yield Implausible(("torque_ratio",), found, usual, is_certain)
    yield from _unusual("drag", airframe.drag, _DRAG, DAMPING)
    yield from _unusual("rotor_time", airframe.rotor_time, _ROTOR_TIME, DURATION)
    lifts = airframe.max_thrust / airframe.hover_thrust
    if lifts > _MAX_RATIO:
        found, usual = f"a thrust of {lifts:.3g} times its weight", f"{_MAX_RATIO:g} times at most"
        yield Implausible(("mass", "thrust"), found, usual, False)
    elif lifts * cos(airframe.tilt) < 1.0:
        found = f"a tilt at which a thrust of {lifts:.3g} times its weight doesn't hold it"
        yield Implausible(("tilt", "thrust"), found, "less, or stronger rotors", False)
    elif lifts < _WEAK:
        found = f"a thrust of {lifts:.3g} times its weight, which leaves too little for control"
        yield Implausible(("thrust", "mass"), found, f"{_WEAK:g} times at least", False)
    yield from _unusual("endurance", airframe.endurance, _ENDURANCE, DURATION)
    bumper, hull = airframe.bumper, airframe.hull
    if bumper is not None and not _BUMPER.has(bumper / hull, False):
        found = f"a bumper of {format_quantity(bumper, LENGTH)} around rotors that reach"
        found += f" {hull:.2g} m from its centre"
        usual = f"{_BUMPER.low * hull:.2g} to {_BUMPER.high * hull:.2g} m"
        yield Implausible(("bumper",), found, usual, not _BUMPER.has(bumper / hull, True))


def _unusual(name: str, value: float, usual: Range, dimension: Dimension) -> Iterator[Implausible]:
    if not usual.has(value, False):
        low, high = (format_quantity(v, dimension) for v in (usual.low, usual.high))
        found = f"`{name}` of {format_quantity(value, dimension)}"
        yield Implausible((name,), found, f"{low} to {high}", not usual.has(value, True))


def of_parcel(parcel: Parcel, airframe: Airframe) -> Iterator[Implausible]:
    """Yield the implausible values of a payload. Its corners, which point along the arms, should
    not reach under the rotors and must not reach beyond the hubs."""
    size, reach = parcel.size, parcel.size / sqrt(2.0)
    free, most = airframe.arm - airframe.rotor_radius, airframe.arm
    if reach > free:
        found = f"a box of {size * 100:.3g} cm would extend under the rotors"
        usual = f"at most {free * sqrt(2.0) * 100:.3g} cm under its airframe"
        yield Implausible(("size",), found, usual, reach > most)
        return
    density = parcel.mass / size**3
    if not _DENSITY.has(density, False):
        found = (
            f"{format_quantity(parcel.mass, MASS)} in a box of {size * 100:.3g} cm are "
            f"{float(f'{density:.3g}'):.0f} kg/m^3"
        )
        usual = f"{_DENSITY.low:g} to {_DENSITY.high:g} kg/m^3"
        yield Implausible(("size", "mass"), found, usual, not _DENSITY.has(density, True))
