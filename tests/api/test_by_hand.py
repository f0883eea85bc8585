"""The check of motion capture by hand: a simulated hand, 30 degrees off and never still, moves a
simulated body, whose measurements alone are judged."""

from __future__ import annotations

import functools
import random
from dataclasses import dataclass
from math import pi

import pytest
from plans import Bent, plan, wrapped
from short_flights import fault, hovers
from toolchain import MISSIONS, compiled, invoke, printed

from kybflow.api.by_hand import HandCheckResult, Tell, check_by_hand
from kybflow.core.geometry import norm
from kybflow.core.signals import NS, Imu, Pose
from kybflow.dsl.plan import PartPlan, SensorPlan
from kybflow.flight.hand_check.motions import HandStep, HandWatch
from kybflow.flight.hand_check.verdict import DeclaredStream, judge
from kybflow.sensors.simulated_motion_capture import (
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams,
)

FIRST = MISSIONS / "first_flight.yaml"
WRONG = {
    "metres read as mm": ({"factor": 1e-3}, {"scale"}, "check the stream's `units`"),
    "mm read as metres": ({"factor": 1e3}, {"scale"}, "check the stream's `units`"),
    "z-up read as y-up": (
        {"exchanged": "yz", "mirrored": "y"}, {"up axis", "y axis"}, "z up instead of y",
    ),
    "y-up read as z-up": (
        {"exchanged": "yz", "mirrored": "z"}, {"up axis", "y axis"}, "y up instead of z",
    ),
    "x and y exchanged": ({"exchanged": "xy"}, {"x axis", "y axis"}, "shows x and y exchanged"),
    "x mirrored": ({"mirrored": "x"}, {"x axis"}, "shows x mirrored"),
    "y mirrored": ({"mirrored": "y"}, {"y axis"}, "shows y mirrored"),
    "NED read as ENU": (
        {"exchanged": "xy", "mirrored": "z", "turned": pi / 2},
        {"up axis", "x axis", "y axis"}, "north-east-down",
    ),
    "body turned by 90": ({"turned": pi / 2}, {"nose"}, "to the left of the nose"),
    "body turned by -90": ({"turned": -pi / 2}, {"nose"}, "to the right of the nose"),
    "body turned by 180": ({"turned": pi}, {"nose"}, "define the body anew"),
}  # fmt: skip
FINE = ({}, {"turned": pi / 6}, {"factor": 0.9})


class Carried(Bent):
    """A bent link to a vehicle that a hand can move."""

    def __init__(self, link, bend=lambda measurement, now: measurement):
        super().__init__(link, bend)
        self.faults = link.faults

    def subscribe(self, kinds):
        self.link.subscribe(kinds)

    def carry(self, way, turn, generator):
        self.link.carry(way, turn, generator)


def checked(rule, seed=0, timeout=60.0, **vehicle) -> tuple[HandCheckResult, list]:
    """The result of a check in which poses are changed by a rule, and what the person was told."""
    told: list = []
    tell = Tell(told.append, told.append, told.append, lambda: told.append("simulated"))
    faults = (fault("mocap_frame", 0.0, **rule),) if rule else ()
    return check_by_hand(plan(hovers(**vehicle), faults=faults), "a", tell, seed, timeout), told


def red(result: HandCheckResult) -> dict[str, str]:
    return {line.check: line.reason for line in result.lines if not line.green}


@functools.cache
def measured(seed: int) -> tuple:
    """What a vehicle in a hand measures."""
    found: list = []

    def keep(measurement, now):
        found.append(measurement)
        return measurement

    result, _ = checked({}, seed, driver=wrapped(lambda _, link: Carried(link, keep)))
    assert (result.stopped, red(result)) == (None, {})
    return tuple(found)


def replayed(rule, seed) -> HandCheckResult:
    """The verdict on what was measured in a hand, in a frame that is changed by a rule."""
    frame = fault("mocap_frame", **rule).part
    change = frame.cls(frame.params, random.Random(0)).effects("a")["a"].filter
    watch = HandWatch()
    for measurement in measured(seed):
        if isinstance(measurement, Imu):
            watch.add_imu(measurement)
        elif isinstance(measurement, Pose):
            watch.add_pose(change(measurement))
    assert watch.step is None
    return HandCheckResult(judge(watch.motions, DeclaredStream(), watch.imu_trouble), None)


def flown(rule, seed) -> HandCheckResult:
    return checked(rule, seed)[0]


def passes(rule, seed, judged):
    result = judged(rule, seed)
    assert (result.stopped, red(result)) == (None, {})


def names(wrong, seed, judged):
    """The verdict on a wrong frame is red exactly where the frame is wrong, and says why once."""
    rule, where, words = WRONG[wrong]
    result = judged(rule, seed)
    found = red(result)
    assert result.stopped is None
    if where & {"up axis", "x axis", "y axis"}:
        assert found.pop("nose") == "not judged before the axes are right"
    assert found.keys() == where
    assert sum(words in reason for reason in found.values()) == 1


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, 2, 17])
def test_a_right_frame_passes_and_a_wrong_one_is_named(seed):
    for rule in FINE:
        passes(rule, seed, replayed)
    for wrong in WRONG:
        names(wrong, seed, replayed)


HANDS = 5
"""Hands with right frames in the thorough tests, each a seed, and one with wrong frames. More are
slow: every run of the tests judges what three hands measured in each of the frames."""


@pytest.mark.thorough
@pytest.mark.parametrize(
    "seed", [s if s < HANDS else pytest.param(s, marks=pytest.mark.slow) for s in range(50)]
)
def test_a_right_frame_passes_in_every_hand(seed):
    for rule in FINE:
        passes(rule, seed, flown)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "seed", [s if s < 1 else pytest.param(s, marks=pytest.mark.slow) for s in range(10)]
)
@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_frame_is_named_in_every_hand(wrong, seed):
    names(wrong, seed, flown)


def without_imu():
    return wrapped(lambda _, link: Carried(link, lambda m, now: None if isinstance(m, Imu) else m))


def test_without_an_imu_the_poses_are_judged_and_what_they_cannot_show_is_said():
    result, _ = checked({}, driver=without_imu())
    assert (result.stopped, red(result)) == (None, {})
    unsure = {line.check for line in result.lines if "no IMU is heard" in line.reason}
    assert unsure == {"scale", "nose"}


@pytest.mark.thorough
@pytest.mark.parametrize(
    "wrong", [name for name in WRONG if name not in ("metres read as mm", "mm read as metres")]
)
def test_without_an_imu_wrong_axes_and_turned_bodies_are_named(wrong):
    rule, where, _ = WRONG[wrong]
    result, _ = checked(rule, driver=without_imu())
    assert result.stopped is None
    assert where <= red(result).keys() <= where | {"nose"}


def test_millimetres_without_an_imu_end_at_the_time_limit_and_name_the_units():
    result, told = checked({"factor": 1e-3}, driver=without_imu(), timeout=8.0)
    assert result.stopped is not None
    assert " mm up" in result.stopped
    assert "`units`" in red(result)["scale"]
    assert told == ["simulated", HandStep.REST, None, HandStep.LIFT]


def test_a_hand_that_covers_the_markers_while_it_moves_is_understood():
    def covering(_, link):
        def bend(measurement, now):
            is_covered = norm(link.truth().velocity) > 0.2
            return None if is_covered and isinstance(measurement, Pose) else measurement

        return Carried(link, bend)

    result, _ = checked({"factor": 1e-3}, driver=wrapped(covering))
    assert result.stopped is None
    assert red(result).keys() == {"scale"}


@dataclass(frozen=True)
class DeclaredParams(SimulatedMotionCaptureParams):
    units: str = "mm"
    axes: str = "z_up"


def test_what_to_write_in_the_mission_is_said_with_its_line():
    part = PartPlan("lab", SimulatedMotionCapture, DeclaredParams(), "sensors.lab", "m.yaml:7")
    result, _ = checked({"factor": 1e-3}, sensors=(SensorPlan(part, ("mocap",)),))
    [line] = [line for line in result.lines if not line.green]
    assert line.reason.endswith("the stream is in m; write `units: m` in its sensor")
    assert line.at == "m.yaml:7"


def test_the_person_is_asked_step_by_step_and_told_what_was_seen():
    _, told = checked({})
    assert told[0] == "simulated"
    assert told[1::2] == list(HandStep)
    assert [None if shown is None else shown.step for shown in told[2::2]] == [
        None, *list(HandStep)[1:],
    ]  # fmt: skip


def test_nothing_is_sent():
    sent = []

    class Watched(Carried):
        def send(self, command, now):
            sent.append(command)

    result, _ = checked({}, driver=wrapped(lambda _, link: Watched(link)))
    assert (red(result), sent) == ({}, [])


def test_an_armed_vehicle_is_not_touched():
    def armed(_, link):
        link = Carried(link)
        link.armed = True
        return link

    result, told = checked({}, driver=wrapped(armed))
    assert "disarm it" in (result.stopped or "")
    assert told == ["simulated"]


def test_who_does_nothing_is_told_what_was_missing():
    class Idle(Carried):
        def carry(self, way, turn, generator): ...

    result, _ = checked({}, driver=wrapped(lambda _, link: Idle(link)), timeout=3.0)
    assert "it was not moved by 18 cm or more" in (result.stopped or "")
    assert red(result)["nose"] == "not judged: the nose was not dipped"


def test_poses_that_do_not_arrive_are_told_at_once():
    """The hand covers the markers for three seconds while it lifts; then they never return."""

    def bend(measurement, now):
        is_seen = now < 2.5 * NS or 5.5 * NS < now < 6.0 * NS
        return measurement if is_seen or not isinstance(measurement, Pose) else None

    driver = wrapped(lambda _, link: Carried(link, bend))
    result, told = checked({}, driver=driver, timeout=10.0)
    assert told == ["simulated", HandStep.REST, None, HandStep.LIFT, *["no pose arrives"] * 2]
    assert result.stopped == "no pose arrives"


@pytest.mark.thorough
@pytest.mark.parametrize("target", ["emulated_px4", "emulated_ardupilot"])
def test_an_autopilot_is_asked_for_its_imu(target):
    """It is heard only once the autopilot has answered."""
    result = check_by_hand(
        compiled(FIRST, warns=True, target=target), "nano", Tell(print, print, print, lambda: None)
    )
    assert (result.stopped, red(result)) == (None, {})
    assert "by the IMU" in result.lines[0].reason


def test_the_command_asks_shows_and_judges():
    code, out = printed("preflight", FIRST, "--by-hand", "nano")
    assert code == 0
    assert "Lift nano straight up by about 30 cm" in out
    assert " cm up\n" in out
    assert [line.split()[0] for line in out.splitlines()[-5:]] == ["green"] * 5


def test_the_command_says_that_it_failed(tmp_path):
    text = FIRST.read_text(encoding="utf-8").replace("library/airframes.yaml", "kybflow/airframes")
    mission = tmp_path / "m.yaml"
    wrong = "{at: 0 s, on: nano, inject: mocap_frame, factor: 0.001}"
    mission.write_text(f"{text}\nfaults: [{wrong}]\n")
    code, out = printed("preflight", mission, "--by-hand", "nano")
    assert code == 1
    assert "`units`" in out


def test_a_vehicle_that_is_not_there_is_refused_with_those_that_are():
    result = invoke("preflight", MISSIONS / "figure_eight.yaml", "--by-hand", "kinton")
    assert result.exit_code == 2
    assert "there is no vehicle `kinton`; the mission has `mk`, `nano`" in " ".join(
        result.output.split()
    )


def test_a_vehicle_without_motion_capture_is_refused():
    result = invoke("preflight", MISSIONS / "courier.yaml", "--by-hand", "courier")
    assert result.exit_code == 2
    said = " ".join(result.output.split())
    assert "no motion capture to check: it is estimated by `fusion`, `inertial`" in said
