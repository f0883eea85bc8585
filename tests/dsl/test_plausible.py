"""Airframes that were built are plausible; numbers in another unit are not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kybflow.world.plausible import of_airframe, of_parcel
from kybflow.world.vehicle_context import Airframe, Parcel

MK = Airframe(mass=1.05, diameter=0.5, inertia=(0.011, 0.011, 0.02), thrust=6.0, rotor_time=0.05)
BUILT = {
    "mk_quadro": MK,
    "crazyflie": Airframe(
        mass=0.027, diameter=0.092, inertia=(1.66e-5, 1.66e-5, 2.93e-5), thrust=0.15,
        torque_ratio=0.006, rotor_time=0.03,
    ),
    "hummingbird": Airframe(
        mass=0.5, diameter=0.34, inertia=(2.6e-3, 2.6e-3, 4.5e-3), thrust=3.5,
        torque_ratio=0.016, rotor_time=0.015,
    ),
    "racer": Airframe(
        mass=0.75, diameter=0.25, inertia=(0.0025, 0.0021, 0.0043), thrust=8.5,
        torque_ratio=0.014, rotor_time=0.03,
    ),
    "matrice": Airframe(
        mass=6.3, diameter=0.895, inertia=(0.25, 0.25, 0.42), thrust=40.0,
        torque_ratio=0.03, rotor_time=0.09,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BUILT)
def test_what_was_built_is_plausible(name: str) -> None:
    assert [*of_airframe(BUILT[name])] == []


@pytest.mark.parametrize(
    ("changed", "parameter", "is_certain"),
    [
        (replace(MK, diameter=500.0), "diameter", True),
        (replace(MK, diameter=0.005), "diameter", True),
        (replace(MK, inertia=(1.1, 1.1, 2.0)), "inertia", True),
        (replace(MK, inertia=(1.1e-4, 1.1e-4, 2e-4)), "inertia", True),
        (replace(MK, inertia=(0.11, 0.11, 0.2)), "inertia", False),
        (replace(MK, torque_ratio=1.6), "torque_ratio", True),
        (replace(MK, rotor_time=5.0), "rotor_time", True),
        (replace(MK, rotor_time=0.2), "rotor_time", False),
        (replace(MK, thrust=60.0), "mass", False),
        (replace(MK, endurance=10.0), "endurance", False),
    ],
)
def test_another_unit_is_told(changed: Airframe, parameter: str, is_certain: bool) -> None:
    found = [(one.parameters[0], one.is_certain) for one in of_airframe(changed)]

    assert (parameter, is_certain) in found


@pytest.mark.parametrize(
    ("mass", "size", "expected"),
    [
        (0.2, 0.1, []),
        (0.2, 0.2, [("size", False)]),
        (0.2, 1.0, [("size", True)]),
        (0.2, 0.01, [("size", True)]),
    ],
)
def test_a_payload_fits_under_its_vehicle(
    mass: float, size: float, expected: list[tuple[str, bool]]
) -> None:
    found = of_parcel(Parcel(mass=mass, size=size), MK)

    assert [(one.parameters[0], one.is_certain) for one in found] == expected
