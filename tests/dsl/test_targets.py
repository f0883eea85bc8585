"""Targets: those that drivers declare, and which tracker a vehicle flies with on which."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, ClassVar

import pytest
from toolchain import compiled, result_of

from kybflow.core.errors import PartError
from kybflow.core.signals import CommandKind
from kybflow.drivers.sim import Sim
from kybflow.dsl.compiler import Result
from kybflow.dsl.expanding.targets import implied_targets
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts.catalog import Catalog, PartSpec, load_catalog

MISSION = """\
kybflow: 1
mission: m
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
vehicles:
  a:
    like: std.nano_plus
    tracker: {use: geometric, proportional: 12}
    behaviors: &hop {up: {do: take_off, height: 1 m, then: down}, down: {do: land}}
  b: {like: std.nano_plus, start: {at: [0, 2, 0]}, behaviors: *hop}
"""


class Yard(Sim):
    """One whose vehicles follow setpoints themselves, unless they are `raw`."""

    accepts = frozenset(CommandKind)
    targets: ClassVar[Any] = {"yard": {"watchdog": False, "live": False}, "sim2": {}}

    @classmethod
    def tracker(cls, params: Any) -> dict[str, str] | None:
        return None if params.live else {"use": "on_board", "by": "velocity"}

    @classmethod
    def watchdog(cls, params: Any) -> None:
        """It has another one."""


class Yards(Catalog):
    """Everything installed, `yard`, and a driver that can't be loaded."""

    def __init__(self) -> None:
        self._all = load_catalog()

    def names(self, kind: str) -> tuple[str, ...]:
        own = ("broken", "yard") if kind == "drivers" else ()
        return (*own, *self._all.names(kind))

    def get(self, kind: str, name: str) -> PartSpec:
        if name == "broken":
            raise PartError("broken")
        spec = self._all.get(kind, "sim" if name == "yard" else name)
        return spec if name != "yard" else PartSpec(kind, name, Yard, *tuple_of(spec))

    def always(self, kind: str) -> tuple[PartSpec, ...]:
        return self._all.always(kind)


def tuple_of(spec: PartSpec) -> tuple[Any, ...]:
    return (spec.params, spec.fields, spec.doc)


def checked(folder: Path, target: str | None, targets: str = "") -> Result:
    text = MISSION + (f"targets: {targets}\n" if targets else "")
    return result_of(folder / "m.yaml", text, catalog=Yards(), target=target)


def vehicles_of(folder: Path, target: str | None, targets: str = "") -> dict[str, VehiclePlan]:
    result = checked(folder, target, targets)
    assert result.diagnostics == ()
    assert result.plan is not None
    return {vehicle.name: vehicle for vehicle in result.plan.vehicles}


def test_drivers_declare_targets_and_one_that_cannot_be_loaded_none() -> None:
    implied = dict(implied_targets(Yards()))
    assert implied["yard"] == {"use": "yard", "watchdog": "false", "live": "false"}
    assert implied["px4"] == {"use": "mavlink", "autopilot": "px4", "simulator": "true"}
    assert implied["ardupilot"] == {
        "use": "mavlink", "autopilot": "ardupilot", "simulator": "true"
    }  # fmt: skip


def test_every_mission_has_them(tmp_path: Path) -> None:
    vehicles = vehicles_of(tmp_path, "yard")
    assert [v.driver.name for v in vehicles.values()] == ["yard", "yard"]
    assert not vehicles["a"].driver.params.watchdog


@pytest.mark.parametrize("target", ["px4", "ardupilot"])
def test_a_firmwares_simulator_is_watched_by_what_the_driver_brings(
    tmp_path: Path, target: str
) -> None:
    vehicles = vehicles_of(tmp_path, target)
    for vehicle in vehicles.values():
        assert vehicle.driver.params.autopilot == target
        assert [s.part.name for s in vehicle.sensors] == ["simulated_motion_capture"]
        assert vehicle.tracker.name == "on_board"


def test_hardware_is_brought_nothing_that_is_simulated(tmp_path: Path) -> None:
    result = checked(tmp_path, "lab", "{lab: {all: {driver: {use: mavlink, autopilot: px4}}}}")
    assert {d.code for d in result.diagnostics} == {"KYB302"}


def test_one_that_the_mission_writes_wins(tmp_path: Path) -> None:
    vehicles = vehicles_of(tmp_path, "yard", "{yard: {all: {driver: sim}}}")
    assert [v.driver.name for v in vehicles.values()] == ["sim", "sim"]


def test_a_vehicle_without_a_driver_there_has_the_implied_one(tmp_path: Path) -> None:
    vehicles = vehicles_of(tmp_path, "yard", "{yard: {a: {driver: sim}}}")
    assert [v.driver.name for v in vehicles.values()] == ["sim", "yard"]


def test_the_trackers_of_a_target(tmp_path: Path) -> None:
    """Its own entry, else that of `all`, else the driver's, else the mission's."""
    trackers = "{a: {tracker: {use: on_board, by: velocity}}, all: {tracker: cascade}}"
    vehicles = vehicles_of(tmp_path, "yard", f"{{yard: {trackers}}}")
    assert vehicles["a"].tracker.params.by == "velocity"
    assert vehicles["b"].tracker.name == "cascade"
    asked = vehicles_of(tmp_path, "yard")
    assert [v.tracker.name for v in asked.values()] == ["on_board", "on_board"]
    assert asked["a"].tracker.params.by == "velocity"
    own = vehicles_of(tmp_path, "yard", "{yard: {all: {driver: {use: yard, live: true}}}}")
    assert own["a"].tracker.params.proportional == 12
    assert own["b"].tracker.name == vehicles_of(tmp_path, "sim")["b"].tracker.name


@pytest.mark.parametrize(
    ("driver", "rate"),
    [
        ("{use: emulated_autopilot}", 100),
        ("{use: emulated_autopilot, physics: 1000 Hz}", 100),
        ("{use: emulated_autopilot, physics: 250 Hz}", 125),
        ("{use: emulated_autopilot, physics: 250 Hz, rate: 10 Hz}", 125),
    ],
)
def test_the_control_rate_that_nobody_wrote_falls_on_the_steps_of_every_vehicle(
    tmp_path: Path, driver: str, rate: int
) -> None:
    result = checked(tmp_path, "dry_run", f"{{dry_run: {{all: {{driver: {driver}}}}}}}")
    assert result.diagnostics == ()
    assert result.plan is not None
    assert result.plan.control_rate == rate


def test_steps_on_which_no_usual_control_rate_falls_are_an_error(tmp_path: Path) -> None:
    driver = "{use: emulated_autopilot, physics: 330 Hz}"
    result = checked(tmp_path, "dry_run", f"{{dry_run: {{all: {{driver: {driver}}}}}}}")
    assert [(d.code, d.message) for d in result.diagnostics][:1] == [
        ("KYB303", "control at 100 Hz does not divide `emulated_autopilot` at 330 Hz")
    ]


@pytest.mark.parametrize(
    "targets",
    [
        "",
        "{yard: {a: {tracker: {use: on_board, by: velocity}}, all: {tracker: cascade}}}",
        "{yard: {all: {driver: {use: yard, live: true}}}}",
        "{yard: {a: {tracker: geometric, sensors: {mocap: {use: vrpn, host: m}}}}}",
    ],
)
def test_the_resolved_mission_is_the_same(tmp_path: Path, targets: str) -> None:
    first = checked(tmp_path, "yard", targets).plan
    assert first is not None
    again = compiled(tmp_path / "resolved.yaml", first.resolved, catalog=Yards(), target="yard")
    for one, other in zip(first.vehicles, again.vehicles, strict=True):
        assert (one.driver.name, one.driver.params) == (other.driver.name, other.driver.params)
        assert (one.tracker.name, one.tracker.params) == (other.tracker.name, other.tracker.params)
        assert [s.part.params for s in one.sensors] == [s.part.params for s in other.sensors]
    assert "proportional: 12" in first.resolved  # the mission's own stays where it was


def test_what_is_wrong_with_the_tracker_of_another_target_is_told(tmp_path: Path) -> None:
    result = checked(tmp_path, None, "{lab: {all: {driver: sim, tracker: {use: cascade, x: 1}}}}")
    assert [d.code for d in result.diagnostics] == ["KYB107"]
    result = checked(tmp_path, None, "{lab: {all: {driver: sim, tracker: none_such}}}")
    assert [(d.code, d.severity.value) for d in result.diagnostics] == [("KYB140", "warning")]


def test_no_driver_is_imported_for_a_target_that_does_not_need_it(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(MISSION + "targets: {lab: {all: {driver: sim}}}\n")
    program = (
        "import json, sys\n"
        "from kybflow.parts.catalog import load_catalog\n"
        "from kybflow.dsl.compiler import compile_mission\n"
        "for target in (None, 'sim', 'lab'):\n"
        f"    compile_mission({str(path)!r}, catalog=load_catalog(), target=target)\n"
        "print(json.dumps([m for m in sys.modules if m.startswith('kybflow.drivers.')]))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300
    )
    assert json.loads(result.stdout) == ["kybflow.drivers.sim"]
