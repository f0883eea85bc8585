"""`kybflow mocap-server`: simulated vehicles on the network."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest
from plans import in_still_air
from toolchain import MISSIONS, compiled, invoke
from waiting import free_port, until

from kybflow.api.flight import RunRequest, fly
from kybflow.core.errors import KybflowError
from kybflow.core.geometry import Quat, Vec3, distance
from kybflow.core.signals import NS, Pose
from kybflow.dsl.plan import Plan
from kybflow.sensors._stream import TrackerPose
from kybflow.sensors.vrpn.client import ServerAddress, subscribe
from kybflow.sensors.vrpn.server import PoseNoise, published, still, to


@pytest.fixture(scope="module")
def plan() -> Plan:
    plan = compiled(MISSIONS / "first_flight.yaml")
    return in_still_air(plan)


@pytest.mark.thorough
def test_every_pose_is_published_and_the_flight_is_the_same(plan: Plan, tmp_path: Path) -> None:
    seen: list[tuple[str, Pose]] = []
    tapped = published(plan, lambda name, pose: seen.append((name, pose)))
    flown = fly(tapped, RunRequest(out=tmp_path / "published"))
    alone = fly(plan, RunRequest(out=tmp_path / "alone"))
    assert flown.summary["vehicles"] == alone.summary["vehicles"]
    assert {name for name, _ in seen} == {vehicle.name for vehicle in plan.vehicles}
    stamps = [pose.time for name, pose in seen if name == plan.vehicles[0].name]
    assert stamps == [round(i * NS / 120) for i in range(len(stamps))]
    assert stamps[-1] / NS == pytest.approx(flown.summary["sim_time_s"], abs=0.03)


def test_real_vehicles_are_not_published(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan.vehicles[0].driver.cls, "simulated", False)
    with pytest.raises(KybflowError, match="flies on `sim`, which is real"):
        published(plan, lambda name, pose: None)


def test_a_body_at_rest_has_noise_and_times_of_its_own() -> None:
    seen: list[tuple[str, Pose]] = []
    places = {"a": (1.0, 2.0, 3.0), "b": (0.0, 0.0, 0.0)}
    step = still(places, lambda *p: seen.append(p), PoseNoise(0.001, 0.01), random.Random(0))
    for i in range(100):
        step(i * NS // 120)
    poses = [pose for name, pose in seen if name == "a"]
    assert len({pose.position for pose in poses}) == 100
    assert all(distance(pose.position, (1.0, 2.0, 3.0)) < 0.005 for pose in poses)
    assert [pose.time for pose in poses] == [i * NS // 120 for i in range(100)]


def test_stamps_begin_now_and_go_on_with_the_run() -> None:
    class Notes:
        stamps: list[int] = []  # noqa: RUF012

        def publish(self, body: str, position: Vec3, attitude: Quat, stamp: int) -> None:
            self.stamps.append(stamp)

    publish = to(Notes(), lambda: 1000 * NS)  # type: ignore[arg-type]
    for time in (5 * NS, 6 * NS, 8 * NS):
        publish("a", Pose(time, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
    assert Notes.stamps == [1000 * NS, 1001 * NS, 1003 * NS]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "what",
    [
        pytest.param([str(MISSIONS / "first_flight.yaml")], marks=pytest.mark.thorough, id="flown"),
        pytest.param(["--still", "a=1,2,3"], id="still"),
    ],
)
def test_the_command_serves_until_it_is_ended(what: list[str], plan: Plan, tmp_path: Path) -> None:
    port = free_port()
    name = "a" if "--still" in what else plan.vehicles[0].name
    out = [] if "--still" in what else ["--out", str(tmp_path / "run")]
    program = [sys.executable, "-m", "kybflow", "mocap-server", *what, "--port", str(port), *out]
    reader = subscribe(ServerAddress("127.0.0.1", port), name, 0)
    with subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        came: list[TrackerPose] = []
        try:
            until(
                lambda: (
                    process.poll() is not None
                    or bool(came.extend(reader.take()))  # type: ignore[func-returns-value]
                    or len(came) > 20
                ),
                "poses of the command",
            )
            assert process.poll() is None
        finally:
            process.kill()
    reader.close()
    stamps = [report.time for report in came]
    assert stamps == sorted(stamps)
    x, y, z = (1.0, 2.0, 3.0) if "--still" in what else plan.vehicles[0].start
    climb = 0.0 if "--still" in what else 1.0  # a reader that connects late sees the take-off
    for report in came[:5]:
        assert distance(report.position[:2], (x, y)) < 0.05
        assert z - 0.05 < report.position[2] < z + climb + 0.05


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "give either a mission or bodies with --still"),
        (["m.yaml", "--still", "a=0,0,0"], "give either a mission or bodies with --still"),
        (["--still", "a=0,0"], "`a=0,0` is not NAME=X,Y,Z"),
        (["--still", "=0,0,0"], "`=0,0,0` is not NAME=X,Y,Z"),
        (["--port", "0", "--still", "a" * 120 + "=0,0,0"], "is not a VRPN name"),
        (["--still", "a=0,0,nan"], "`a=0,0,nan` is not NAME=X,Y,Z"),
    ],
)
def test_what_it_can_not_do_is_said(arguments: list[str], says: str) -> None:
    result = invoke("mocap-server", *arguments)
    assert result.exit_code == 2
    assert says in result.output


def test_a_mission_with_errors_is_told_before_anything_listens() -> None:
    result = invoke("mocap-server", "nosuch.yaml")
    assert result.exit_code == 2
    assert "error[KYB001]: `nosuch.yaml` can't be read" in result.output
    assert "VRPN server on" not in result.output
