"""A payload needs a driver that moves a servo, on the target that is flown."""

from __future__ import annotations

from pathlib import Path

import pytest
from hardware_catalog import HardwareCatalog
from toolchain import compiled, result_of

from kybflow.drivers.sim import Sim
from kybflow.world.vehicle_context import Parcel

MISSION = """
kybflow: 1
mission: drop
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
vehicles:
  a:
    like: std.courier_quad
    payload: {mass: 300 g, size: 12 cm}
    behaviors:
      up:   {do: take_off, height: 1 m, then: drop}
      drop: {do: release_payload, then: down}
      down: {do: land}
targets:
  lab: {a: {driver: bench}}
"""


class Bench(Sim):
    simulated = False
    grips = False


@pytest.mark.parametrize(
    ("target", "found"),
    [
        ("sim", []),
        ("lab", ["KYB396 `release_payload` needs a servo, but the driver `bench` has none"]),
    ],
)
def test_a_driver_without_a_servo_refuses_the_release(tmp_path: Path, target, found) -> None:
    catalog = HardwareCatalog(Bench)
    result = result_of(tmp_path / "m.yaml", MISSION, catalog=catalog, target=target)
    assert [f"{d.code} {d.message}" for d in result.diagnostics] == found


def test_the_plan_has_it_in_si_and_the_resolved_mission_means_the_same(tmp_path: Path) -> None:
    plan = compiled(tmp_path / "m.yaml", MISSION, catalog=HardwareCatalog(Bench))
    assert plan.vehicles[0].payload == Parcel(mass=0.3, size=0.12, channel=1, aboard=True)
    resolved = compiled(tmp_path / "again.yaml", plan.resolved, catalog=HardwareCatalog(Bench))
    assert resolved.vehicles[0].payload == plan.vehicles[0].payload
