"""Airframes that others simulate are plausible; numbers in another unit are not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kybflow.world.plausible import of_airframe, of_parcel
from kybflow.world.vehicle_context import Airframe, Parcel

MK = Airframe(mass=1.05, diameter=0.5, inertia=(0.011, 0.011, 0.02), thrust=6.0, rotor_time=0.05)
BUILT = {
    "mk_quadro": MK,
    "RotorPy's Crazyflie": Airframe(
        mass=0.03, diameter=0.086, inertia=(1.43e-5, 1.43e-5, 2.89e-5), thrust=0.144,
        torque_ratio=0.0339, rotor_time=0.072,
    ),
    "RotorPy's Crazyflie without brushes": Airframe(
        mass=0.044, diameter=0.086, inertia=(3.3e-5, 3.6e-5, 5.9e-5), thrust=0.389,
        torque_ratio=0.0193, rotor_time=0.05,
    ),
    "RotorPy's Hummingbird": Airframe(
        mass=0.5, diameter=0.34, inertia=(3.65e-3, 3.68e-3, 7.03e-3), thrust=12.5,
        torque_ratio=0.0244, rotor_time=0.005,
    ),
    "RotorS's Hummingbird": Airframe(
        mass=0.716, diameter=0.34, inertia=(0.007, 0.007, 0.012), thrust=6.0,
        torque_ratio=0.016, rotor_time=0.0125,
    ),
    "PX4's simulation in hardware": Airframe(
        mass=1.0, diameter=0.34, inertia=(0.025, 0.025, 0.03), thrust=5.0,
        torque_ratio=0.02, rotor_time=0.05,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BUILT)
def test_airframes_of_others_are_plausible(name: str) -> None:
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
        (replace(MK, drag=60.0), "drag", True),
        (replace(MK, drag=4.0), "drag", False),
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
