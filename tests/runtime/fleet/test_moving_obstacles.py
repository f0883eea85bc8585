"""Moving obstacles: where they are, how fast they go, and that nobody sees them any more."""

import random
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from math import inf, nan

import pytest
from part_bench import SITE

from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL, Vec3, distance, norm, scale, sub
from kybflow.core.signals import NS, Battery, Event, Measurement, Pose, Time
from kybflow.parts import Stream
from kybflow.runtime.events import Events, WorldObserver
from kybflow.runtime.fleet.moving_obstacles import MovingObstacles, moving_obstacles
from kybflow.sensors.simulated_motion_capture import (
    BodyStream,
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams,
    truth_of,
)
from kybflow.world.shapes import MovingSphere
from kybflow.world.vehicle_context import VehicleContext

BALL = MovingSphere(((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0)), 0.1, 0.5)
STEP = NS // 100


def test_it_goes_there_and_back_and_stops_at_each_point() -> None:
    ramp = 0.5 / 1.5
    leg = 1.0 / 0.5 + ramp
    assert BALL.at(0.0) == (0.0, 0.0, 1.0)
    assert BALL.at(0.5 * leg) == pytest.approx((0.5, 0.0, 1.0))
    assert BALL.at(leg) == pytest.approx((1.0, 0.0, 1.0))
    assert BALL.at(1.5 * leg) == pytest.approx((1.0, 0.5, 1.0))
    assert BALL.at(2.5 * leg) == pytest.approx((1.0, 0.5, 1.0))
    assert BALL.at(4.0 * leg) == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
    assert MovingSphere(((1.0, 2.0, 3.0),), 0.1, 0.5).at(7.0) == (1.0, 2.0, 3.0)


def test_it_is_no_faster_than_told_and_never_jolts() -> None:
    places = [BALL.at(0.01 * i) for i in range(2000)]
    speeds = [scale(sub(b, a), 100.0) for a, b in pairwise(places)]
    assert max(norm(v) for v in speeds) == pytest.approx(0.5, abs=1e-6)
    assert max(norm(sub(b, a)) for a, b in pairwise(speeds)) < 0.0151


class Seen(Stream):
    """A pose of the ball each 10 ms, 20 ms late, wherever `at` says that it is seen."""

    def __init__(self, at: Callable[[float], Vec3 | None] = BALL.at) -> None:
        self._at = at
        self.why: str | None = None

    def read(self, now: Time) -> Sequence[Measurement]:
        if self.why == "broken":
            raise DriverError("broken")
        time = now - 2 * STEP
        place = self._at(time / NS)
        return () if place is None or time < 0 else (Pose(time, place, LEVEL),)

    def trouble(self) -> str | None:
        return self.why

    def close(self) -> None:
        """Nothing is open."""


def watched(
    stream: Stream, steps: Iterable[int] = range(300)
) -> tuple[MovingObstacles, list[Event]]:
    told: list[Event] = []
    moving = moving_obstacles({"ball": BALL}, Events((told.append,)), {"ball": stream})
    for i in steps:
        moving.step(i * STEP)
    return moving, told


def test_it_is_where_it_was_seen_and_its_velocity_is_that_of_late() -> None:
    moving, told = watched(Seen(), range(100))
    seen = moving.seen["ball"]
    assert seen.time == 97 * STEP
    assert seen.position == pytest.approx(BALL.at(0.97))
    assert seen.velocity == pytest.approx((0.5, 0.0, 0.0))
    assert told == []


def test_what_is_no_pose_is_neither_followed_nor_recorded() -> None:
    class Both(Seen):
        def read(self, now: Time) -> Sequence[Measurement]:
            return (*super().read(now), Battery(now, 1.0, 12.0))

    class Noted(WorldObserver):
        def body(self, now: Time, name: str, measurement: Measurement) -> None:
            kinds.add(type(measurement))

    kinds: set[type] = set()
    moving = moving_obstacles({"ball": BALL}, Events(), {"ball": Both()}, Noted())
    for i in range(10):
        moving.step(i * STEP)
    assert kinds == {Pose}
    assert moving.seen["ball"].time == 7 * STEP


def test_one_that_is_not_seen_is_told_and_found_again() -> None:
    stream = Seen(lambda t: None if 1.0 <= t < 2.0 else BALL.at(t))
    stream.why = "the server is gone"
    moving, told = watched(stream)
    assert [event.name for event in told] == ["obstacle_lost", "obstacle_found"]
    reason = "not seen for 0.5 s: the server is gone"
    assert told[0].fields == {"obstacle": "ball", "reason": reason}
    assert [*moving.objections(299 * STEP)] == [("ball", None)]


def test_nobody_takes_off_beside_one_that_was_never_seen() -> None:
    moving, told = watched(Seen(lambda t: None))
    assert told == []
    assert [*moving.objections(299 * STEP)] == [("ball", "it is not seen")]


def test_a_stream_that_raises_is_one_that_sees_nothing() -> None:
    stream = Seen()
    moving, told = watched(stream)
    stream.why = "broken"
    for i in range(300, 400):
        moving.step(i * STEP)
    assert [event.name for event in told] == ["obstacle_lost"]
    assert "broken" in str(told[0].fields["reason"])


def test_a_pose_that_is_repeated_bit_by_bit_is_of_a_body_that_is_lost() -> None:
    still = random.Random(1)

    def at(t: float) -> Vec3:
        return (1.0, 0.0, 1.0) if t > 1.0 else (1.0 + still.gauss(0.0, 1e-3), 0.0, 1.0)

    _, told = watched(Seen(at))
    assert [event.name for event in told] == ["obstacle_lost"]


def test_one_that_stands_and_is_measured_without_noise_is_seen() -> None:
    _, told = watched(Seen(lambda t: (1.0, 0.0, 1.0)))
    assert told == []


def test_a_body_that_is_taken_for_another_is_no_faster_than_told() -> None:
    moving, _ = watched(Seen(lambda t: (3.0, 0.0, 1.0) if t > 1.0 else BALL.at(t)), range(104))
    assert moving.seen["ball"].position == (3.0, 0.0, 1.0)
    assert norm(moving.seen["ball"].velocity) == pytest.approx(0.5)


def test_what_is_no_place_and_what_comes_late_is_left_out() -> None:
    wrong = {1.0: (nan, 0.0, 0.0), 1.01: (inf, 0.0, 0.0)}
    moving, _ = watched(Seen(lambda t: wrong.get(round(t, 2), BALL.at(t))), range(104))
    assert moving.seen["ball"].time == 99 * STEP


def test_simulated_motion_capture_sees_it_late_and_with_noise() -> None:
    params = SimulatedMotionCaptureParams(latency=0.03, position_noise=0.002)
    context: VehicleContext = SITE
    stream = BodyStream(
        truth_of(BALL),
        lambda link: SimulatedMotionCapture.open(params, context, link, random.Random(3)),
    )
    poses = [pose for i in range(200) for pose in stream.read(i * STEP)]
    assert len(poses) == pytest.approx(197, abs=2)
    off = [distance(pose.position, BALL.at(pose.time / NS)) for pose in poses]
    assert 0.001 < sum(off) / len(off) < 0.006
    assert poses[-1].time <= 199 * STEP - 0.03 * NS
