"""Faults on a target that is no simulation, with drivers made up for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from hardware_catalog import HardwareCatalog
from toolchain import compiled, result_of

from kybflow.drivers.sim import Sim

MISSION = """\
kybflow: 1
mission: two
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
vehicles:
  a: {like: std.mk_quadro, behaviors: &hop {up: {do: take_off, height: 1 m, then: down},
      down: {do: land}}}
  b: {like: std.nano_plus, start: {at: [0, 2, 0]}, behaviors: *hop}
targets:
  lab: {a: {driver: bench}, b: {driver: sim}}
faults:
  - {at: 1 s, on: a, inject: gust, velocity: [1, 0, 0], for: 1 s}
  - {at: 1 s, on: b, inject: gust, velocity: [1, 0, 0]}
  - {when: elapsed > 1 s, on: b, inject: mocap_swap, other: a}
"""


class Bench(Sim):
    simulated = False


def checked(tmp_path: Path, target: str) -> list[str]:
    catalog = HardwareCatalog(Bench)
    result = result_of(tmp_path / "two.yaml", MISSION, catalog=catalog, target=target)
    return [f"{d.span.line} {d.code} {d.message}: {d.label}" for d in result.diagnostics]


def test_a_fault_is_refused_where_nothing_is_simulated_and_the_target_is_named(tmp_path) -> None:
    assert checked(tmp_path, "sim") == []
    assert checked(tmp_path, "lab") == [
        "12 KYB331 `gust` can't be injected on the target `lab`: "
        "`a` flies on `bench`, which is no simulation",
        "14 KYB331 `mocap_swap` can't be injected on the target `lab`: "
        "`a` flies on `bench`, which is no simulation",
    ]


class Firmware(Bench):
    """A firmware's own simulator, whose truth is known and whose vehicle can't be broken."""

    @classmethod
    def shows(cls, params: Any) -> bool:
        return True


def test_on_a_firmwares_simulator_our_side_can_be_broken_and_the_vehicle_not(tmp_path) -> None:
    ours = ["mocap_dropout", "link_cut"]
    text = MISSION + "".join(f"  - {{at: 2 s, on: a, inject: {name}}}\n" for name in ours)
    catalog = HardwareCatalog(Firmware)
    result = result_of(tmp_path / "two.yaml", text, catalog=catalog, target="lab")
    found = [(d.span.line, d.code, d.label) for d in result.diagnostics]
    why = (
        "`a` flies on `bench`, which is another program's simulator: only what kybflow receives"
        " from it can be broken"
    )
    assert found == [(12, "KYB331", why), (14, "KYB331", why)]


def test_the_plan_has_every_fault_in_si(tmp_path) -> None:
    plan = compiled(tmp_path / "two.yaml", MISSION, catalog=HardwareCatalog(Bench))
    first, second, third = plan.faults
    assert (first.vehicle, first.time, first.when, first.duration) == ("a", 1.0, None, 1.0)
    assert (first.part.name, first.part.params.velocity) == ("gust", (1.0, 0.0, 0.0))
    assert first.at.endswith("two.yaml:12")
    assert second.duration is None
    assert (third.time, third.part.params.other) == (None, "a")
    assert third.when is not None


def test_the_resolved_mission_has_every_fault_and_reads_back(tmp_path) -> None:
    plan = compiled(tmp_path / "two.yaml", MISSION, catalog=HardwareCatalog(Bench))
    again = compiled(tmp_path / "again.yaml", plan.resolved, catalog=HardwareCatalog(Bench))
    assert [replace(f, at="", part=replace(f.part, at="")) for f in again.faults] == [
        replace(f, at="", part=replace(f.part, at="")) for f in plan.faults
    ]
