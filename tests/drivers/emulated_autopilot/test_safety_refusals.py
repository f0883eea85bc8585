"""What an autopilot refuses ends the run, or goes where the mission says, with its own words and
the mission's line."""

from __future__ import annotations

from dataclasses import replace

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from dry_runs import AUTOPILOTS, DRIVER, UP, DryRun, supervised
from plans import part, state, then
from short_flights import down, hold, up
from toolchain import invoke

from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.dsl.plan import TransitionPlan
from kybflow.world.vehicle_context import Parcel

thorough = pytest.mark.thorough
STARTS = "behavior_started"
WORDS = {
    "tilt": {"px4": "Attitude failure", "ardupilot": "Leaning"},
    "battery": {"px4": "low battery", "ardupilot": "low voltage"},
    "refuse": dict.fromkeys(AUTOPILOTS, "Compass not calibrated"),
}
BROKEN = {"tilt": 35.0, "battery": 0.1, "refuse": "PreArm: Compass not calibrated"}
QUICK = {("px4", "tilt"), ("ardupilot", "refuse")}
MISSION = """
kybflow: 1
mission: bare
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}}}
targets:
  bare:
    all:
      driver: {{use: emulated_autopilot, autopilot: {autopilot}, prepared: false}}
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up: {{do: take_off, height: 1 m, then: down}}
      down: {{do: land}}
"""


def broken(**failures):
    def deed(flight):
        for name, value in failures.items():
            setattr(flight.pilot.failures, name, value)

    return deed


def mission():
    climb = replace(up("hold"), at=UP)
    failed = TransitionPlan(target="ground", cause="failed")
    climb = replace(climb, transitions=(*climb.transitions, failed))
    return [climb, hold(1.0, "down"), down(), state("ground", part("behaviors", "wait_on_ground"))]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("autopilot", "what"),
    [
        pytest.param(name, what, marks=[] if (name, what) in QUICK else [thorough])
        for name in AUTOPILOTS
        for what in BROKEN
    ],
)
def test_it_will_not_arm(autopilot, what, tmp_path):
    breaks = (STARTS, broken(**{what: BROKEN[what]}))
    states = mission() if (autopilot, what) in QUICK else None
    unasked = supervised(battery={"warn_below": 0.05, "land_below": 0.05})  # ours is not asked
    flight = DryRun(autopilot, tmp_path, on=breaks, states=states, supervisors=unasked)
    refused = flight.only("arming_refused")
    assert refused.at == UP
    assert WORDS[what][autopilot] in refused.fields["reason"]
    assert {s.armed for s in flight.samples} == {False}
    if states is None:
        assert flight.path == ["up", "landed"]
        assert WORDS[what][autopilot] in flight.flown.summary["reason"]
        assert flight.flown.exit_code == 1
    else:
        assert flight.path == ["up", "ground"]
        assert flight.flown.exit_code == 0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("autopilot", "what", "check", "words"),
    [
        ("px4", "bar", "command mode", "not today"),
        ("ardupilot", "blind", "position", "it has none"),
        pytest.param("ardupilot", "bar", "command mode", "not today", marks=thorough),
        pytest.param("px4", "blind", "position", "it has none", marks=thorough),
    ],
)
def test_it_does_not_pass_the_preflight(autopilot, what, check, words, tmp_path):
    failure = {"bar": "Mode change denied: not today", "blind": True}[what]
    flight = DryRun(autopilot, tmp_path, deeds=[(0.0, broken(**{what: failure}))])
    found = {event.fields["check"]: event for event in flight.events("preflight_failed")}
    assert found[check].at == DRIVER
    assert words in found[check].fields["reason"]
    assert flight.flown.exit_code == 1
    assert flight.path == []


def test_px4_is_never_in_offboard_without_set_points(tmp_path):
    """So that it is never refused for want of them."""
    flight = DryRun("px4", tmp_path, deeds=[(0.0, starts_watching)])
    assert flight.follows
    assert all(flight.follows)
    assert flight.events("arming_refused") == []


def starts_watching(flight):
    """Look at every change of mode: does the autopilot hear setpoints then?"""
    flight.follows, change = [], flight.pilot.change

    def watched(mode, now, *, asked):
        if mode == flight.pilot.firmware.follow and asked:
            flight.follows.append(flight.pilot.state.streams(now))
            if len(flight.follows) == 1:
                flight.engine.interrupts = 1
        change(mode, now, asked=asked)

    flight.pilot.change = watched


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_its_servo_is_not_set_up(autopilot, tmp_path):
    output = profile_of(autopilot).output(1, True).parameter

    def unset(flight):
        flight.pilot.state.parameters._values[output] = 0.0 if autopilot == "px4" else 33.0

    drop = replace(state("drop", part("behaviors", "release_payload"), then("down")), at="m.yaml:6")
    failed = TransitionPlan(target="down", cause="failed")
    drop = replace(drop, transitions=(*drop.transitions, failed))
    states = [replace(up("drop"), at=UP), drop, down()]
    parcel = Parcel(mass=0.03, size=0.05, channel=1)
    flight = DryRun(
        autopilot, tmp_path, states=states, payload=parcel, deeds=[(0.0, unset)],
    )  # fmt: skip
    failed = flight.only("behavior_failed")
    assert failed.fields["behavior"] == "drop"
    assert output in failed.fields["reason"], failed.fields["reason"]
    assert flight.is_safe()


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_the_preflight_names_each_parameter_that_is_wrong_and_the_cure(autopilot, tmp_path):
    file = tmp_path / "bare.yaml"
    file.write_text(MISSION.format(autopilot=autopilot), encoding="utf-8")
    done = invoke("preflight", file, "--target", "bare")
    assert done.exit_code == 1
    lines = done.output.splitlines()
    [at] = [i for i, line in enumerate(lines) if " parameters " in line and "RED" in line]
    assert "are wrong for flight without GPS" in lines[at]
    wrong = {
        "px4": ("EKF2_EV_CTRL is 0,", "SYS_HAS_GPS is 1,"),
        "ardupilot": ("VISO_TYPE is 0,", "EK3_SRC1_POSXY is 3,"),
    }[autopilot]
    for words in (*wrong, DANGEROUS[autopilot], f"kybflow mavlink setup --vehicle {autopilot}"):
        assert done.output.count(words) == 1


DANGEROUS = {"px4": "COM_OBL_RC_ACT is 0:", "ardupilot": "FS_GCS_ENABLE is 0:"}


@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_a_run_tells_each_parameter_that_is_wrong_once(autopilot, tmp_path):
    file = tmp_path / "bare.yaml"
    file.write_text(MISSION.format(autopilot=autopilot), encoding="utf-8")
    asked = ["run", str(file), "--target", "bare", "--out", str(tmp_path / "run"), "--no-report"]
    done = invoke(*asked)
    assert done.exit_code == 1
    wrong = {"px4": "EKF2_EV_CTRL is 0,", "ardupilot": "VISO_TYPE is 0,"}[autopilot]
    for words in (wrong, DANGEROUS[autopilot], f"kybflow mavlink setup --vehicle {autopilot}"):
        assert done.output.count(words) == 1
    [_, end] = done.output.split("bare FAILED: ")
    assert "more red lines" in end
