"""Dimensions, their units, and the annotated types that carry them.

For mypy, `Length` is a plain `float`, in metres. The compiler reads the dimension from the
annotation to decode `1.2 m`, to write the JSON Schema and to print tables of parameters. Inside
kybflow every value is in the SI unit of its dimension.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args

from kybflow.core.errors import PartError, UnitError
from kybflow.core.text import as_typed

Vec3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Dimension:
    """What a quantity measures. si: the symbol of the SI unit. units: the factor to SI of each
    unit, by its symbol. example: a quantity as written. bare_allowed: whether a number without a
    unit is accepted, as SI."""

    name: str
    si: str
    units: dict[str, float]
    example: str
    bare_allowed: bool = True

    def __hash__(self) -> int:
        return hash(self.name)


DEG = math.pi / 180.0
"""One degree in radians."""

NUMBER = Dimension("number", "", {}, "2")
LENGTH = Dimension("length", "m", {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3}, "1.2 m")
SPEED = Dimension(
    "speed", "m/s", {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6}, "0.5 m/s"
)
ACCELERATION = Dimension(
    "acceleration", "m/s^2", {"m/s^2": 1.0, "m/s2": 1.0, "cm/s^2": 1e-2}, "2 m/s^2"
)
ANGLE = Dimension("angle", "rad", {"deg": DEG, "rad": 1.0}, "20 deg", bare_allowed=False)
ANGULAR_RATE = Dimension(
    "angular rate", "rad/s", {"deg/s": DEG, "rad/s": 1.0}, "50 deg/s", bare_allowed=False
)
ANGULAR_ACCELERATION = Dimension(
    "angular acceleration", "rad/s^2", {"deg/s^2": DEG, "rad/s^2": 1.0}, "2 rad/s^2"
)
DURATION = Dimension("duration", "s", {"s": 1.0, "ms": 1e-3, "min": 60.0}, "300 ms")
FREQUENCY = Dimension("frequency", "Hz", {"Hz": 1.0, "kHz": 1e3}, "120 Hz")
MASS = Dimension("mass", "kg", {"kg": 1.0, "g": 1e-3}, "1.05 kg")
INERTIA = Dimension("inertia", "kg m^2", {"kg m^2": 1.0, "g m^2": 1e-3}, "0.012 kg m^2")
FORCE = Dimension("force", "N", {"N": 1.0, "mN": 1e-3}, "2.3 N")
TORQUE = Dimension("torque", "N m", {"N m": 1.0, "mN m": 1e-3}, "0.1 N m")
VISCOSITY = Dimension("viscous friction", "N s/m", {"N s/m": 1.0}, "0.3 N s/m")
ROTARY_VISCOSITY = Dimension("rotary viscous friction", "N m s", {"N m s": 1.0}, "0.02 N m s")
RATIO = Dimension("ratio", "", {"%": 1e-2}, "20 %")
DAMPING = Dimension("rate constant", "1/s", {"1/s": 1.0}, "0.25 1/s")
VOLTAGE = Dimension("voltage", "V", {"V": 1.0, "mV": 1e-3}, "14.8 V")

DIMENSIONS: dict[str, Dimension] = {
    d.name: d
    for d in (
        NUMBER, LENGTH, SPEED, ACCELERATION, ANGLE, ANGULAR_RATE, ANGULAR_ACCELERATION, DURATION,
        FREQUENCY, MASS, INERTIA, FORCE, TORQUE, VISCOSITY, ROTARY_VISCOSITY, RATIO, DAMPING,
        VOLTAGE,
    )
}  # fmt: skip
"""Every dimension, by name."""

Number = Annotated[float, NUMBER]
"""A dimensionless number. Each type below is a float, or a tuple of floats, in its SI unit."""
Length = Annotated[float, LENGTH]
Speed = Annotated[float, SPEED]
Acceleration = Annotated[float, ACCELERATION]
Angle = Annotated[float, ANGLE]
AngularRate = Annotated[float, ANGULAR_RATE]
AngularAcceleration = Annotated[float, ANGULAR_ACCELERATION]
Duration = Annotated[float, DURATION]
Frequency = Annotated[float, FREQUENCY]
Mass = Annotated[float, MASS]
Inertia = Annotated[float, INERTIA]
Force = Annotated[float, FORCE]
Torque = Annotated[float, TORQUE]
Viscosity = Annotated[float, VISCOSITY]
RotaryViscosity = Annotated[float, ROTARY_VISCOSITY]
Ratio = Annotated[float, RATIO]
"""A fraction; 1.0 is 100 %."""
Damping = Annotated[float, DAMPING]
"""A rate constant, 1/s."""
Voltage = Annotated[float, VOLTAGE]
Position = Annotated[Vec3, LENGTH]
Velocity = Annotated[Vec3, SPEED]
AngularVelocity = Annotated[Vec3, ANGULAR_RATE]
Accelerations = Annotated[Vec3, ACCELERATION]
Forces = Annotated[Vec3, FORCE]
Inertias = Annotated[Vec3, INERTIA]
Path = Annotated[tuple[Vec3, ...], LENGTH]
"""A sequence of positions of any length."""


@dataclass(frozen=True, slots=True)
class MatrixOf:
    """The size of a matrix and the dimension of its entries."""

    rows: int
    columns: int
    dimension: Dimension


RowsOfNumbers = tuple[tuple[float, ...], ...]
if TYPE_CHECKING:
    from typing_extensions import TypeAliasType

    _R = TypeVar("_R")
    _C = TypeVar("_C")
    _U = TypeVar("_U")
    Matrix = TypeAliasType("Matrix", tuple[tuple[_U, ...], ...], type_params=(_R, _C, _U))
else:

    class Matrix:
        """The type of a matrix, `Matrix[ROWS, COLUMNS, UNIT]`, as in `Matrix[3, 3, Damping]`. mypy
        accepts no number as a type argument and requires `Matrix[Literal[3], Literal[3],
        Damping]`."""

        def __class_getitem__(cls, of: Any) -> Any:
            *sizes, unit = of if isinstance(of, tuple) else (of,)
            sizes = [get_args(size)[0] if get_args(size) else size for size in sizes]
            [*_, dimension] = get_args(unit) or (None,)
            is_sized = len(sizes) == 2 and all(isinstance(s, int) and s > 0 for s in sizes)
            if not is_sized or get_args(unit)[:1] != (float,):
                raise PartError("a matrix is declared like `Matrix[3, 3, Damping]`")
            return Annotated[RowsOfNumbers, MatrixOf(*sizes, dimension)]


# A number and then a unit: `1.2 m`, `-3e-2m/s`, `0.25 1/s`.
_QUANTITY = re.compile(
    r"[ \t]*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[ \t]*([^\d\s.,].*?|1/s)?[ \t]*\Z", re.ASCII
)
_COMMA = re.compile(r"(?<=\d)\s*[.,]\s*(?=\d)")
_APART = re.compile(r"^([+-])\s+")


def parse_quantity(text: str, dimension: Dimension) -> float:
    """Parse `text` and return its value in the SI unit of `dimension`.

    Raises UnitError if the text is not a finite quantity, lacks a required unit, or has a unit of
    another dimension.
    """
    match = _QUANTITY.match(text)
    if match is None:
        typed = _COMMA.sub(".", _APART.sub(r"\1", as_typed(text).strip()))
        corrected = _QUANTITY.match(typed)
        hint = f"write it like `{dimension.example}`"
        if corrected is not None and (corrected[2] or "") in {"", *dimension.units}:
            hint = f"write `{typed}`"
        raise UnitError(f"`{text}` is not {article(dimension.name)}", hint)
    value = float(match[1])
    unit = match[2] or ""
    factor = _factor(text, match[1], unit, dimension)
    if not math.isfinite(value * factor):
        raise UnitError(f"`{text}` is not finite", f"write it like `{dimension.example}`")
    return value * factor


def _factor(text: str, number: str, unit: str, dimension: Dimension) -> float:
    if not unit:
        if dimension.bare_allowed:
            return 1.0
        choices = " or ".join(f"`{number} {u}`" for u in dimension.units)
        raise UnitError(f"{article(dimension.name)} needs a unit", f"write {choices}")
    if unit in dimension.units:
        return dimension.units[unit]
    for other in DIMENSIONS.values():
        if unit in other.units:
            raise UnitError(
                f"`{text}` is {article(other.name)}, but {article(dimension.name)} is needed",
                f"minutes are `min`: `{number} min`"
                if dimension is DURATION and unit == "m"
                else f"write it like `{dimension.example}`",
            )
    if (typed := as_typed(unit).strip()) in dimension.units:
        raise UnitError(f"`{text}` has characters of another script", f"write `{number} {typed}`")
    known = ", ".join(f"`{u}`" for u in dimension.units) or "none"
    raise UnitError(
        f"`{unit}` is not a unit of {dimension.name}", f"the units of {dimension.name} are {known}"
    )


_DIGIT_GROUPS = re.compile(r"(?<=\d)_(?=\d)")


def parse_number(text: str) -> float:
    """Parse a number in a text that a person or another program wrote, such as a cell of a table.

    `nan` and `inf` are numbers here. What `float` accepts beyond that is refused: underscores,
    which a typing error leaves in a number, and digits of other scripts. Raises UnitError.
    """
    if text.isascii() and "_" not in text:
        with suppress(ValueError):
            return float(text)
    shown, typed = text.strip()[:20], _DIGIT_GROUPS.sub("", as_typed(text).strip())
    point = _COMMA.sub(".", _APART.sub(r"\1", typed))
    match = _QUANTITY.match(point)
    if match is None or match[2]:
        raise UnitError(f"`{shown}` is not a number", "")
    flaw = "is not written like a number"
    if "," in typed:
        flaw = "has a decimal comma"
    elif "_" in text:
        flaw = "has an underscore"
    elif not text.isascii():
        flaw = "has another keyboard's characters"
    with_point = ", with a decimal point" if "," in typed else ""
    raise UnitError(f"`{shown}` {flaw}", f"write `{point}`{with_point}")


def finite_number(text: str) -> float:
    """Parse a number as `parse_number` does, but not `nan` or `inf`. Raises UnitError."""
    value = parse_number(text)
    if not math.isfinite(value):
        raise UnitError(f"`{text.strip()[:20]}` is not finite")
    return value


def is_quantity(text: str, dimension: Dimension) -> bool:
    """Return whether `text` is a quantity of `dimension`."""
    try:
        parse_quantity(text, dimension)
    except UnitError:
        return False
    return True


def article(noun: str) -> str:
    """Return `noun` with `a` or `an` before it."""
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


def format_quantity(value: float, dimension: Dimension) -> str:
    """Format a value (SI) in the unit in which people write it: `0.034 m`, `20 deg`, `15 %`."""
    if dimension is ANGLE or dimension is ANGULAR_RATE:
        return f"{value / DEG:.4g} {'deg' if dimension is ANGLE else 'deg/s'}"
    if dimension is RATIO:
        return f"{value * 100:.4g} %"
    return f"{float(f'{value:.4g}'):g} {dimension.si}".rstrip()


_READABLE = {"rad": (1 / DEG, "deg"), "rad/s": (1 / DEG, "deg/s")}
_SMALL = {"m": (100.0, "cm"), "m/s": (100.0, "cm/s")}


def format_measured(value: float, si: str, sign: str = "") -> str:
    """Format a measured value in the SI unit `si` for a report: three significant digits, angles in
    degrees, lengths and speeds below one in centimetres. sign: "+" shows the sign of positive
    values."""
    factor, unit = _READABLE.get(si, (1.0, si))
    if si in _SMALL and abs(value) < 1.0:
        factor, unit = _SMALL[si]
    return f"{value * factor:{sign}.3g} {unit}".rstrip()
