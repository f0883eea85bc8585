"""The driver: missions fly on emulated autopilots as on real ones, in lockstep."""

from __future__ import annotations

import json
import random
import subprocess
import sys

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from sim_worlds import seat
from toolchain import MISSIONS, compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS, Odometry, Pose
from kybflow.drivers.emulated_autopilot import EmulatedAutopilot, EmulatedAutopilotParams
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot


def mission_flight(mission, target, out, **request):
    plan = compiled(MISSIONS / mission, target=target, warns=True)
    return fly(plan, RunRequest(out=out, **request))


def test_importing_the_part_loads_neither_mujoco_nor_pymavlink():
    code = (
        "import sys, kybflow.drivers.emulated_autopilot;"
        " print({'mujoco', 'numpy', 'pymavlink'} & set(sys.modules))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"


@pytest.mark.thorough
def test_a_mission_flies_on_ardupilot_without_a_change(tmp_path):
    done = mission_flight("first_flight.yaml", "emulated_ardupilot", tmp_path / "run")
    assert done.summary["outcome"] == "succeeded", done.summary["expectations"]


@pytest.mark.thorough
def test_a_mission_flies_on_px4_and_the_same_seed_gives_the_same_events(tmp_path):
    told = []
    for name in ("a", "b"):
        done = mission_flight("first_flight.yaml", "emulated_px4", tmp_path / name, seed=4)
        assert done.summary["outcome"] == "succeeded", done.summary["expectations"]
        lines = (tmp_path / name / "events.jsonl").read_text().splitlines()
        told.append([json.loads(line) for line in lines])
    assert told[0] == told[1]


@pytest.mark.parametrize(
    "autopilot", [pytest.param("px4", marks=pytest.mark.thorough), "ardupilot"]
)
def test_motion_capture_comes_beside_what_the_autopilot_tells(autopilot):
    params = EmulatedAutopilotParams(autopilot=autopilot, position="own")
    session = EmulatedAutopilot.open((seat(params=params),), random.Random(1))
    link, measured = session.links["a"], []
    for tick in range(1, 250 * 20):
        session.advance(tick * NS // 250)
        measured += link.read(tick * NS // 250)
    session.close()
    assert {Pose, Odometry} <= {type(m) for m in measured}
    assert link.faults is not None
    assert link.truth() == link.view()
    assert isinstance(link.onboard, OnboardAutopilot)
