"""Stale, frozen, jumping and swapped bodies are told apart."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from math import cos, nan, sin
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plans import part, vehicle
from short_flights import down, hold, named, path, up

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import LEVEL, Vec3, add, from_euler, from_heading
from kybflow.core.signals import NS, Estimate, Pose
from kybflow.core.units import DURATION
from kybflow.dsl.expressions import Compare, Quantity, Read
from kybflow.dsl.plan import EstimatorPlan, FaultPlan
from kybflow.flight.pose_gate import AGREEING_POSES
from kybflow.parts.events import BodyFroze, BodyJumped, BodyLost, BodyRecovered, BodySwapped
from kybflow.runtime.monitoring.bodies import Bodies, BodyBounds

TICK = NS // 250
FLEET = ("a", "b", "c")
Change = Callable[[str, Pose], Pose | None]


class Found(NamedTuple):
    """What was found, of which body and when."""

    time: int
    body: str
    event: VehicleEvent


def flight(name: str, time: int) -> Pose:
    """A circle at 1.5 m/s with tilt, each vehicle 1.2 m from the next."""
    t, k = time / NS, FLEET.index(name)
    centre = (1.2 * k, 0.0, 1.0)
    position = add(centre, (0.3 * cos(5 * t + k), 0.3 * sin(5 * t + k), 0.0))
    return Pose(time, position, from_euler(0.2 * sin(5 * t), 0.2 * cos(5 * t), 0.5 * t))


def watched(
    change: Change, seconds: float, names: tuple[str, ...] = FLEET, rate: int = 120, seed: int = 1
) -> tuple[list[Found], dict[str, list[Pose]]]:
    """What is found while `names` fly, their poses (0.5 mm of noise) as `change` makes them."""
    generator, bodies = random.Random(seed), Bodies()
    findings: list[Found] = []
    passed: dict[str, list[Pose]] = {name: [] for name in names}
    count = dict.fromkeys(names, 0)
    for tick in range(round(seconds * NS / TICK)):
        now = tick * TICK
        for name in names:
            poses = []
            while (stamp := count[name] * NS // rate) <= now:
                count[name] += 1
                pose = flight(name, stamp)
                x, y, z = (p + generator.gauss(0.0, 0.0005) for p in pose.position)
                changed = change(name, pose._replace(position=(x, y, z)))
                if changed is not None:
                    poses.append(changed)
            good, found = bodies.judge(name, poses, now)
            passed[name] += good
            findings += [Found(now, name, event) for event in found]
    return findings, passed


def from_second(begin: float, body: str, what: Callable[[Pose], Pose | None], end: float = 1e9):
    """`what` of the poses of `body` from a second on."""

    def change(name: str, pose: Pose) -> Pose | None:
        return what(pose) if name == body and begin <= pose.time / NS < end else pose

    return change


def moved(by: Vec3) -> Callable[[Pose], Pose]:
    return lambda pose: pose._replace(position=add(pose.position, by))


@pytest.mark.parametrize("rate", [30, 120, 240])
def test_a_good_flight_is_no_finding_and_every_pose_passes(rate: int) -> None:
    findings, passed = watched(lambda name, pose: pose, 5.0, rate=rate)
    assert findings == []
    assert all(len(poses) >= 5 * rate for poses in passed.values())


def test_a_body_that_is_lost_and_comes_back() -> None:
    findings, _ = watched(from_second(1.0, "a", lambda pose: None, 2.0), 3.0)
    (lost, back) = findings
    assert isinstance(lost.event, BodyLost)
    assert (lost.body, back.body, back.event) == ("a", "a", BodyRecovered())
    assert 1.24 <= lost.time / NS <= 1.26
    assert lost.event.value > lost.event.bound == 0.25
    assert 2.0 <= back.time / NS <= 2.05


def test_a_body_that_never_comes() -> None:
    findings, _ = watched(from_second(0.0, "a", lambda pose: None), 1.0)
    assert [(f.body, type(f.event)) for f in findings] == [("a", BodyLost)]


def test_a_frozen_body_is_withheld_at_once_and_told_after_the_bound() -> None:
    still = flight("a", NS)
    frozen = from_second(1.0, "a", lambda pose: still._replace(time=pose.time), 2.0)
    findings, passed = watched(frozen, 3.0)
    froze, back = findings
    assert isinstance(froze.event, BodyFroze)
    assert (froze.body, back.body, back.event) == ("a", "a", BodyRecovered())
    assert 1.5 < froze.time / NS <= 1.52
    assert froze.event.value > froze.event.bound == 0.5
    assert 2.0 < back.time / NS <= 2.05
    assert [p.time for p in passed["a"] if NS < p.time < 2 * NS] == []


def still(bodies: Bodies, times: Sequence[int], airborne: bool) -> tuple[int, list[type]]:
    """(how many poses of a body that stands still pass, what is found)."""
    count, found = 0, list[type]()
    for time in times:
        passed, findings = bodies.judge("a", [Pose(time, (0.0, 0.0, 0.0), LEVEL)], time, airborne)
        count += len(passed)
        found += map(type, findings)
    return count, found


def test_what_stands_still_without_noise_is_not_frozen_before_it_flies() -> None:
    bodies = Bodies()
    assert still(bodies, range(0, 2 * NS, NS // 100), airborne=False) == (200, [])
    assert still(bodies, range(2 * NS, 3 * NS, NS // 100), airborne=True) == (0, [BodyFroze])


def test_what_wavered_on_the_ground_and_stands_still_is_frozen_there_too() -> None:
    """A vehicle that takes off meanwhile would climb until its link fails."""
    bodies = Bodies()
    noise = random.Random(1)
    for time in range(0, NS, NS // 100):
        there = (noise.gauss(0.0, 0.0005), 0.0, 0.0)
        bodies.judge("a", [Pose(time, there, LEVEL)], time, airborne=False)
    passed, told = still(bodies, range(NS, 2 * NS, NS // 100), airborne=False)
    assert passed <= 1
    assert told == [BodyFroze]


def test_what_froze_in_the_air_is_withheld_on_the_ground_until_it_moves() -> None:
    bodies = Bodies()
    still(bodies, range(0, NS, NS // 100), airborne=True)
    assert still(bodies, range(NS, 2 * NS, NS // 100), airborne=False) == (0, [])
    poses = [Pose(2 * NS + i, (0.001 * i, 0.0, 0.0), LEVEL) for i in range(1, 4)]
    passed, findings = bodies.judge("a", poses, 2 * NS + 3, airborne=False)
    assert (passed, findings) == (poses, [BodyRecovered()])


@pytest.mark.parametrize("rate", [3, 5, 8])
def test_a_slow_stream_is_not_lost_between_its_poses_but_when_it_ends(rate: int) -> None:
    findings, _ = watched(from_second(3.0, "a", lambda pose: None), 5.0, rate=rate)
    started = 0 if rate > 3 else 3  # at 3 Hz nobody can tell before three poses have come
    [lost] = [f.event for f in findings if f.body == "a" and f.time > 2 * NS]
    assert isinstance(lost, BodyLost)
    assert lost.bound == pytest.approx(3.0 / rate, abs=0.02)
    assert len([f for f in findings if isinstance(f.event, BodyLost) and f.time < NS]) <= started


def test_due_is_when_a_body_is_lost() -> None:
    bodies = Bodies()
    still(bodies, range(0, NS, NS // 100), airborne=False)
    due = bodies.due("a")
    assert due == 99 * NS // 100 + NS // 4
    assert bodies.judge("a", [], due)[1] == []
    assert [type(event) for event in bodies.judge("a", [], due + 1)[1]] == [BodyLost]


def test_a_frozen_body_whose_stream_ends_is_stale() -> None:
    def change(name: str, pose: Pose) -> Pose | None:
        if name != "a" or pose.time < NS:
            return pose
        return flight("a", NS)._replace(time=pose.time) if pose.time < 2 * NS else None

    findings, _ = watched(change, 3.0)
    assert [type(f.event) for f in findings] == [BodyFroze, BodyLost]


def test_frames_that_a_server_sends_twice_are_no_finding_and_pass_once() -> None:
    last: list[Pose] = []

    def twice(name: str, pose: Pose) -> Pose:
        if name != "a":
            return pose
        if last:
            return last.pop()._replace(time=pose.time)
        last.append(pose)
        return pose

    findings, passed = watched(twice, 2.0)
    assert findings == []
    assert len(passed["a"]) == pytest.approx(len(passed["b"]) / 2, abs=1)


@pytest.mark.parametrize("by", [(1.0, 0.0, 0.5), (0.0, 0.0, -0.3), (0.0, 5.0, 0.0)])
def test_a_body_that_jumps_and_goes_on_from_there(by: Vec3) -> None:
    findings, passed = watched(from_second(1.0, "a", moved(by)), 2.0)
    (jump,) = findings
    assert isinstance(jump.event, BodyJumped)
    assert jump.body == "a"
    assert jump.time == pytest.approx(NS, abs=AGREEING_POSES * NS // 120)
    assert jump.event.value > jump.event.bound
    assert len(passed["a"]) == len(passed["b"])


@pytest.mark.parametrize("unseen", [0.6, 10.0])
def test_a_body_that_comes_back_where_a_flight_can_have_brought_it_has_not_jumped(
    unseen: float,
) -> None:
    def change(name: str, pose: Pose) -> Pose | None:
        if name != "a" or pose.time < NS:
            return pose
        return None if pose.time < (1.0 + unseen) * NS else moved((1.65, 0.0, 0.0))(pose)

    findings, passed = watched(change, unseen + 2.0, ("a",))
    assert [type(f.event) for f in findings] == [BodyLost, BodyRecovered]
    assert passed["a"][-1].time > (unseen + 1.9) * NS


def believing(at: dict[str, Vec3]) -> Bodies:
    bodies = Bodies()
    for name, place in at.items():
        estimate = Estimate(0, place, (0.0, 0.0, 0.0), LEVEL, (0.0, 0.0, 0.0), "mocap", 0.0, 0.01)
        bodies.know(name, lambda estimate=estimate: estimate)
    return bodies


def come_back(bodies: Bodies, place: Vec3) -> tuple[int, list[VehicleEvent]]:
    """How many poses pass of a body that was at zero and comes back at `place` two seconds later,
    and what is found of it."""
    times = (0, *range(2 * NS, 3 * NS, NS // 100))
    poses = [
        Pose(t, add(place if t else (0.0, 0.0, 0.0), (1e-12 * t, 0.0, 0.0)), LEVEL) for t in times
    ]
    passed, findings = bodies.judge("a", poses, 3 * NS)
    return len(passed), findings


def test_a_body_that_comes_back_where_another_vehicle_believes_to_be_is_that_ones() -> None:
    bodies = believing({"a": (0.3, 0.0, 0.0), "b": (1.2, 0.0, 0.0)})
    passed, [found] = come_back(bodies, (1.25, 0.0, 0.0))
    assert passed == 1
    assert isinstance(found, BodySwapped)
    assert found.other == "b"
    back = [Pose(3 * NS + i, (0.3 + 1e-6 * i, 0.0, 0.0), LEVEL) for i in range(1, 6)]
    again, findings = bodies.judge("a", back, 3 * NS + 6)
    assert [type(event) for event in findings] == [BodyJumped]
    assert again == back[2:]


def test_a_body_that_comes_back_to_its_own_vehicle_is_none_of_its_neighbours() -> None:
    bodies = believing({"a": (1.15, 0.0, 0.0), "b": (1.3, 0.0, 0.0)})
    assert come_back(bodies, (1.2, 0.0, 0.0)) == (101, [])


def test_a_body_that_is_turned_over_at_a_stroke_has_jumped() -> None:
    over = from_heading(2.0)
    findings, _ = watched(from_second(1.0, "a", lambda p: p._replace(attitude=over)), 1.2)
    [jump] = [f.event for f in findings]
    assert isinstance(jump, BodyJumped)
    assert jump.bound < jump.value < 3.2


def test_a_single_reflection_is_no_finding() -> None:
    findings, _ = watched(from_second(1.0, "a", moved((1.0, 0.0, 0.0)), 1.01), 2.0)
    assert findings == []


@pytest.mark.parametrize("names", [FLEET, FLEET[::-1]])
@pytest.mark.parametrize("seed", range(5))
def test_two_bodies_that_are_exchanged_and_exchanged_back(
    names: tuple[str, ...], seed: int
) -> None:
    swap = {"a": "b", "b": "a"}

    def change(name: str, pose: Pose) -> Pose:
        if name in swap and 1.0 <= pose.time / NS < 2.0:
            other = flight(swap[name], pose.time)
            noise = tuple(
                p - q for p, q in zip(pose.position, flight(name, pose.time)[1], strict=True)
            )
            return other._replace(position=add(other.position, noise))
        return pose

    findings, passed = watched(change, 3.0, names, seed=seed)
    assert all(isinstance(f.event, BodySwapped) for f in findings)
    told = sorted((round(f.time / NS), f.body, f.event.other) for f in findings)
    assert told == [(1, "a", "b"), (1, "b", "a"), (2, "a", "b"), (2, "b", "a")]
    for name in swap:
        kept = [pose.time / NS for pose in passed[name]]
        assert not [time for time in kept if 1.03 < time < 2.0]
        assert kept[-1] > 2.9


def test_a_body_that_is_taken_for_another_which_stays() -> None:
    def change(name: str, pose: Pose) -> Pose:
        away = (0.001, 0.0, 0.0)
        return moved(away)(flight("b", pose.time)) if name == "a" and pose.time >= NS else pose

    findings, _ = watched(change, 2.0)
    [swap] = findings
    assert isinstance(swap.event, BodySwapped)
    assert (swap.body, swap.event.other) == ("a", "b")


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0, 0.0), (nan, 0.0, 0.0, 0.0)])
def test_what_is_no_pose_never_passes_and_is_as_if_none_came(attitude: tuple[float, ...]) -> None:
    findings, passed = watched(
        from_second(1.0, "a", lambda pose: pose._replace(attitude=attitude)), 2.0
    )
    assert [(f.body, type(f.event)) for f in findings] == [("a", BodyLost)]
    assert max(pose.time for pose in passed["a"]) < NS


def test_a_stamp_that_is_not_newer_is_left_out() -> None:
    bodies = Bodies()
    poses = [Pose(t, (0.001 * t, 0.0, 0.0), LEVEL) for t in (1, 3, 2, 3, 4)]
    assert [pose.time for pose in bodies.judge("a", poses, 4)[0]] == [1, 3, 4]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(FLEET),
            st.integers(0, NS),
            st.tuples(*[st.floats(-10, 10)] * 3),
            st.tuples(*[st.floats()] * 4),
        ),
        max_size=40,
    )
)
def test_whatever_comes_it_never_raises_and_what_passes_is_newer(data: list) -> None:
    bodies, newest, now = Bodies(BodyBounds(lost=0.1)), dict.fromkeys(FLEET, -1), 0
    for name, step, position, attitude in data:
        now += step
        for pose in bodies.judge(name, [Pose(now, position, attitude)], now)[0]:
            assert pose.time > newest[name]
            newest[name] = pose.time


EVENTS = ("body_lost", "body_froze", "body_jumped", "body_swapped", "body_recovered")
HEALTHY = Compare("<", Read("mocap", "estimate.age"), Quantity(0.1, DURATION))
FALLBACK = (
    EstimatorPlan(part("estimators", "mocap"), healthy=HEALTHY, recover_after=0.5),
    EstimatorPlan(part("estimators", "inertial"), recover_after=1.0, for_at_most=3.0),
)  # fmt: skip


def flier(name="a", **more):
    return vehicle(name, [up("hold"), hold(4.0, "down"), down()], **more)


def fault(name, lasts, **params):
    return FaultPlan(
        part=part("faults", name, **params),
        vehicle="a",
        time=4.0,
        when=None,
        duration=lasts,
        at="m.yaml:9",
    )


def bodies(told):
    return [(e.vehicle, e.name) for e in told if e.name in EVENTS]


@pytest.mark.thorough
def test_noiseless_motion_capture_is_never_frozen(run):
    quiet = part("drivers", "sim", mocap_position_noise=0.0, mocap_attitude_noise=0.0)
    flown, told = run(flier(driver=quiet))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    assert bodies(told) == []


@pytest.mark.parametrize(
    ("name", "event"),
    [
        ("mocap_frozen", "body_froze"),
        pytest.param("mocap_dropout", "body_lost", marks=pytest.mark.thorough),
    ],
)
def test_a_body_that_freezes_or_is_lost_is_told_and_the_fallback_flies(run, name, event):
    flown, told = run(flier(estimators=FALLBACK), faults=(fault(name, 1.0),))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    assert bodies(told) == [("a", event), ("a", "body_recovered")]
    [first] = named(told, event)
    assert first.fields["value"] > first.fields["bound"] > 0.2
    _, away, back = named(told, "estimator_changed")
    assert (away.fields["estimator"], back.fields["estimator"]) == ("inertial", "mocap")
    assert away.time - 4_000_000_000 < 150_000_000
    assert flown.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"]["max"] < 0.3


@pytest.mark.thorough
def test_true_poses_are_flown_on_again_though_dead_reckoning_drifted(run):
    """It drifts by 0.7 m in the 1.54 s in which nothing true is measured; then poses are far from
    it, but agree, and are believed."""
    bias = fault("imu_bias_step", 1.7, accelerometer=(0.6, 0.0, 0.0))
    flown, told = run(flier(estimators=FALLBACK), faults=(bias, fault("mocap_frozen", 1.54)))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    assert bodies(told) == [("a", "body_froze"), ("a", "body_recovered")]
    [refused], [accepted] = named(told, "position_refused"), named(told, "position_accepted")
    assert refused.fields["estimator"] == accepted.fields["estimator"] == "mocap"
    assert "m from the estimate" in refused.fields["reason"]
    assert accepted.fields["value"] == pytest.approx(0.3, abs=0.02)
    [*_, back] = named(told, "estimator_changed")
    assert back.fields["estimator"] == "mocap"
    assert back.time - accepted.time < 50_000_000


@pytest.mark.thorough
def test_a_body_that_jumps_is_told_and_the_vehicle_ends_on_the_ground(run):
    _, told = run(flier(estimators=FALLBACK), faults=(fault("mocap_jump", None),))
    assert bodies(told)[0] == ("a", "body_jumped")
    [jump, *_] = named(told, "body_jumped")
    assert jump.fields["value"] == pytest.approx(1.0, abs=0.05)
    assert named(told, "landed")


@pytest.mark.thorough
def test_two_bodies_that_are_exchanged_are_told_with_their_names(run):
    two = (flier("a"), flier("b", start=(0.6, 0.0, 0.0)))
    _, told = run(*two, faults=(fault("mocap_swap", None, other="b"),))
    found = {(e.vehicle, e.fields["other"]) for e in named(told, "body_swapped")}
    assert found == {("a", "b"), ("b", "a")}
    assert {e.vehicle for e in named(told, "landed")} == {"a", "b"}
