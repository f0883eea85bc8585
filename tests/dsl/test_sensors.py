"""Sensors of a target: who has which, what a driver brings, and what the plan has of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from hardware_catalog import HardwareCatalog
from toolchain import compiled, result_of

from kybflow.core.signals import Frame
from kybflow.drivers.sim import Sim
from kybflow.dsl.plan import Plan

MISSION = """\
kybflow: 1
mission: m
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  tags: {floor: {grid: {family: 36h11, count: [4, 4], size: 20 cm, spacing: 2 cm}}}
vehicles:
  a:
    like: std.courier_quad
    estimators:
      - {use: tag_camera, healthy: age < 300 ms}
      - {use: tag_camera, as: spare, healthy: age < 300 ms}
      - {use: mocap, healthy: age < 300 ms}
    behaviors: &hop {up: {do: take_off, height: 1 m, then: down}, down: {do: land}}
  b: {like: std.nano_plus, start: {at: [0, 2, 0]}, behaviors: *hop}
targets:
"""
SIMULATED = "{use: simulated_camera}"


class Bench(Sim):
    simulated = False
    brings = ()


def checked(folder: Path, target: str, name: str = "sim") -> tuple[Plan | None, list[str]]:
    text = f"{MISSION}  {name}: {target}\n"
    result = result_of(folder / "m.yaml", text, catalog=HardwareCatalog(Bench), target=name)
    return result.plan, [f"{d.code} {d.message}" for d in result.diagnostics]


def plan_of(checked: tuple[Plan | None, list[str]]) -> Plan:
    """The plan of a mission in which nothing is found."""
    plan, found = checked
    assert found == []
    assert plan is not None
    return plan


def sensors(plan: Plan) -> dict[str, list[tuple[str, tuple[str, ...], str]]]:
    """Of each vehicle: the part, the estimators it is named for, its label."""
    return {
        v.name: [(s.part.name, s.estimators, s.part.label) for s in v.sensors]
        for v in plan.vehicles
    }


def test_the_simulator_brings_a_camera_where_an_estimator_needs_one(tmp_path: Path) -> None:
    plan = plan_of(checked(tmp_path, "{}"))
    brought = ("simulated_camera", (), "sensors.simulated_camera")
    assert sensors(plan) == {"a": [brought], "b": []}
    assert plan.vehicles[0].sensors[0].part.cls.provides == {Frame}


def test_a_named_one_comes_in_place_of_it(tmp_path: Path) -> None:
    own = "{a: {sensors: {tag_camera: {use: simulated_camera, latency: 0.1 s}}}}"
    plan = plan_of(checked(tmp_path, own))
    assert sensors(plan)["a"] == [("simulated_camera", ("tag_camera",), "sensors.tag_camera")]
    assert plan.vehicles[0].sensors[0].part.params.latency == 0.1


def test_all_holds_for_those_who_have_the_estimator(tmp_path: Path) -> None:
    both = f"{{all: {{sensors: {{tag_camera: {SIMULATED}, mocap: {{use: vrpn, host: mocap}}}}}}}}"
    plan = checked(tmp_path, both)[0]
    assert plan is not None
    names = {vehicle: [use[0] for use in of] for vehicle, of in sensors(plan).items()}
    assert names == {"a": ["simulated_camera", "vrpn"], "b": ["vrpn"]}


def test_the_vehicles_own_entry_comes_before_that_of_all(tmp_path: Path) -> None:
    late = "{use: simulated_camera, latency: 0.2 s}"
    both = f"{{all: {{sensors: {{spare: {SIMULATED}}}}}, a: {{sensors: {{spare: {late}}}}}}}"
    (sensor,) = plan_of(checked(tmp_path, both)).vehicles[0].sensors
    assert (sensor.estimators, sensor.part.params.latency) == (("spare",), 0.2)


def test_one_that_two_estimators_share_is_opened_once(tmp_path: Path) -> None:
    both = f"{{a: {{sensors: {{tag_camera: {SIMULATED}, spare: {SIMULATED}}}}}}}"
    shared = ("simulated_camera", ("tag_camera", "spare"), "sensors.tag_camera")
    assert sensors(plan_of(checked(tmp_path, both)))["a"] == [shared]


FRONT = "{front: {at: [0, 0, 0], width: 640, height: 480, field_of_view: 90 deg}}"


def two_videos(folder: Path, target: str) -> tuple[Plan | None, list[str]]:
    """A vehicle with the cameras `down` and `front`, and two files."""
    for name in ("down.avi", "front.avi"):
        (folder / name).write_text("frames")
    like = "    like: std.courier_quad\n"
    carried = f"    airframe: {{like: std.courier_quad, cameras: {FRONT}}}\n"
    text = MISSION.replace(like, like + carried, 1) + f"  sim: {target}\n"
    result = result_of(folder / "m.yaml", text, catalog=HardwareCatalog(Bench))
    return result.plan, [f"{d.code} {d.message}" for d in result.diagnostics]


DOWN = "{use: camera, video: down.avi, camera: down}"
OTHER = "{use: camera, video: front.avi, camera: front}"


def test_an_estimator_may_have_several(tmp_path: Path) -> None:
    both = f"{{a: {{sensors: {{tag_camera: [{DOWN}, {OTHER}]}}}}}}"
    assert sensors(plan_of(two_videos(tmp_path, both)))["a"] == [
        ("camera", ("tag_camera",), "sensors.tag_camera"),
        ("camera", ("tag_camera",), "sensors.tag_camera.1"),
    ]


def test_a_list_comes_in_place_of_that_of_all(tmp_path: Path) -> None:
    both = f"all: {{sensors: {{tag_camera: [{DOWN}, {OTHER}]}}}}"
    own = f"{{{both}, a: {{sensors: {{tag_camera: [{OTHER}]}}}}}}"
    (one,) = sensors(plan_of(two_videos(tmp_path, own)))["a"]
    assert one == ("camera", ("tag_camera",), "sensors.tag_camera")


def test_a_video_is_beside_the_file_that_names_it(tmp_path: Path) -> None:
    plan, _ = two_videos(tmp_path, f"{{a: {{sensors: {{tag_camera: {DOWN}}}}}}}")
    assert plan is not None
    assert plan.vehicles[0].sensors[0].part.params.video == str(tmp_path / "down.avi")


def test_the_resolved_mission_finds_its_videos_from_anywhere(tmp_path: Path) -> None:
    first, _ = two_videos(tmp_path, f"{{a: {{sensors: {{tag_camera: [{DOWN}, {OTHER}]}}}}}}")
    assert first is not None
    copy = tmp_path / "run" / "resolved.yaml"
    copy.parent.mkdir()
    second = compiled(copy, first.resolved, catalog=HardwareCatalog(Bench))
    assert [s.part.params for s in second.vehicles[0].sensors] == [
        s.part.params for s in first.vehicles[0].sensors
    ]
    assert sensors(second) == sensors(first)


def test_a_video_of_another_target_may_be_missing(tmp_path: Path) -> None:
    lab = "{a: {driver: sim, sensors: {tag_camera: {use: camera, video: none.avi}}}}"
    text = f"{MISSION}  lab: {lab}\n"
    result = result_of(tmp_path / "m.yaml", text, catalog=HardwareCatalog(Bench))
    assert [(d.code, d.severity.value) for d in result.diagnostics] == [("KYB370", "warning")]
    assert result.plan is not None


def test_hardware_brings_nothing_and_takes_no_simulated_sensor(tmp_path: Path) -> None:
    plan, found = checked(tmp_path, "{all: {driver: bench}}", "lab")
    assert plan is None
    assert found == ["KYB302 `tag_camera` needs frame measurements"] * 2
    given = f"{{all: {{driver: bench}}, a: {{sensors: {{tag_camera: {SIMULATED}}}}}}}"
    plan, found = checked(tmp_path, given, "lab")
    assert plan is None
    assert found == ["KYB392 `simulated_camera` observes only simulated vehicles"]


def test_a_sensor_of_another_target_that_is_not_installed_is_a_warning(tmp_path: Path) -> None:
    text = f"{MISSION}  lab: {{all: {{driver: sim, sensors: {{mocap: lidar}}}}}}\n"
    result = result_of(tmp_path / "m.yaml", text, catalog=HardwareCatalog(Bench))
    assert [(d.code, d.severity.value) for d in result.diagnostics] == [("KYB140", "warning")]
    assert result.plan is not None


def test_a_sensor_that_knows_its_own_lens_changes_that_of_the_vehicle(tmp_path: Path) -> None:
    (tmp_path / "cam.yaml").write_text(
        "image_width: 800\nimage_height: 600\n"
        "camera_matrix: {data: [500, 0, 400, 0, 500, 300, 0, 0, 1]}\n"
        "distortion_coefficients: {data: [0.1, 0, 0, 0]}\n"
    )
    own = "{a: {sensors: {tag_camera: {use: camera, calibration: cam.yaml}}}}"
    plan = plan_of(checked(tmp_path, own))
    camera = plan.vehicles[0].cameras["down"]
    assert (camera.lens.width, camera.lens.distortion[0], camera.rate) == (800, 0.1, 30.0)
    assert [s.path.rpartition("/")[2] for s in plan.sources].count("cam.yaml") == 1


@pytest.mark.parametrize("target", ["{}", f"{{a: {{sensors: {{spare: {SIMULATED}}}}}}}"])
def test_the_resolved_mission_has_the_same_sensors(tmp_path: Path, target: str) -> None:
    first, _ = checked(tmp_path, target)
    assert first is not None
    second = compiled(tmp_path / "resolved.yaml", first.resolved, catalog=HardwareCatalog(Bench))
    assert sensors(second) == sensors(first)
    assert second.tags == first.tags
    assert [v.cameras for v in second.vehicles] == [v.cameras for v in first.vehicles]
