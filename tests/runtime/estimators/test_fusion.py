"""The fusion is as good as it says it is, whatever the order in which measurements come."""

from __future__ import annotations

import random
from collections.abc import Sequence
from math import degrees, radians, sqrt
from typing import Any, ClassVar, NamedTuple

import numpy
import pytest
from figure_eight_flight import (
    SITE,
    SKY,
    STEADY,
    TICK,
    Instant,
    World,
    attitude,
    figure,
    fusion,
    last,
    moments,
    velocity,
    where,
)

from kybflow.core.geometry import conjugate, distance, multiply, sub
from kybflow.core.signals import NS, Frame, Imu, Measurement, Pose, Position
from kybflow.runtime.estimators.fusion import Fusion, FusionParams


class Flight:
    """A flown figure. errors: metres, from 3 s on. nees: by the second, of position, velocity and
    attitude, and of the position alone. biases: what is left of them, in their deviations at the
    start."""

    def __init__(self, world: World, part: Fusion) -> None:
        self.errors: list[float] = []
        self.nees: dict[int, tuple[float, float]] = {}
        for truth, estimate in moments(part, world.flight()):
            if truth.time > 3 * NS:
                assert estimate is not None
                self.errors.append(distance(estimate.position, truth.position))
                if truth.time % NS == 0:
                    self.nees[truth.time // NS] = nees(part, truth)
        nominal = part.filter.nominal
        assert nominal is not None
        self.force_bias = distance(nominal.accelerometer_bias, world.force_bias)
        self.turn_bias = distance(nominal.gyro_bias, world.turn_bias)


def nees(part: Fusion, truth: Instant) -> tuple[float, float]:
    state = part.filter.state
    assert state is not None
    nominal = state.nominal
    assert nominal.time == truth.time
    w, x, y, z = multiply(conjugate(nominal.attitude), truth.attitude)
    two = 2.0 if w > 0.0 else -2.0
    moved = sub(truth.position, nominal.position)
    error = numpy.array([*moved, *sub(truth.velocity, nominal.velocity), two * x, two * y, two * z])
    return tuple(
        float(error[:n] @ numpy.linalg.solve(state.covariance[:n, :n], error[:n])) for n in (9, 3)
    )  # type: ignore[return-value]


def band(freedom: int, runs: int) -> tuple[float, float]:
    """In which the average of `runs` squared errors lies in 95 % of all cases (chi-square, Wilson
    and Hilferty's approximation; Bar-Shalom, Li and Kirubarajan 2001, sec. 5.4.2)."""
    k = freedom * runs
    low, high = ((1 - 2 / (9 * k) + s * 1.96 * sqrt(2 / (9 * k))) ** 3 * freedom for s in (-1, 1))
    return low, high


def assert_consistent(flights: Sequence[Flight]) -> None:
    for which, freedom in enumerate((9, 3)):
        low, high = band(freedom, len(flights))
        averages = [
            sum(flight.nees[second][which] for flight in flights) / len(flights)
            for second in flights[0].nees
        ]
        inside = sum(low <= average <= high for average in averages)
        assert inside >= 0.85 * len(averages), averages
        assert low <= sum(averages) / len(averages) <= high, averages


@pytest.fixture(scope="module")
def by_poses() -> list[Flight]:
    return [Flight(World(seed, 9.0), fusion()) for seed in range(10)]


@pytest.fixture(scope="module")
def by_positions() -> list[Flight]:
    skies = (World(seed, 16.0, **SKY) for seed in range(4))
    return [Flight(sky, fusion(source="position", position_noise=0.001)) for sky in skies]


@pytest.mark.thorough
def test_late_noisy_poses_are_enough_and_it_knows_how_good_it_is(by_poses: list[Flight]) -> None:
    errors = [error for flight in by_poses for error in flight.errors]
    assert sum(errors) / len(errors) < 0.03
    assert max(errors) < 0.15
    assert_consistent(by_poses)


@pytest.mark.thorough
def test_the_biases_are_found(by_poses: list[Flight]) -> None:
    assert max(flight.force_bias for flight in by_poses) < 0.05
    assert max(degrees(flight.turn_bias) for flight in by_poses) < 0.25


def test_positions_alone_are_enough_though_the_heading_is_unknown(
    by_positions: list[Flight],
) -> None:
    for flight in by_positions:
        converged = flight.errors[len(flight.errors) // 2 :]
        assert sum(converged) / len(converged) < 0.3
    assert max(degrees(flight.turn_bias) for flight in by_positions) < 0.05
    assert_consistent(by_positions)


@pytest.mark.slow
def test_it_is_consistent_over_many_flights() -> None:
    assert_consistent([Flight(World(100 + seed, 20.0), fusion()) for seed in range(25)])
    skies = (World(200 + seed, 25.0, **SKY) for seed in range(20))
    sure = {"source": "position", "position_noise": 0.001}
    assert_consistent([Flight(sky, fusion(**sure)) for sky in skies])


def test_a_wrong_heading_is_learnt_where_the_vehicle_speeds_up() -> None:
    context = SITE._replace(heading=radians(20.0))
    part = Fusion(FusionParams(source="position", position_noise=0.001, **STEADY), context)

    estimate = last(part, World(3, 25.0, **SKY).flight())

    truth = figure(25.0)[-1]
    w, *_ = multiply(conjugate(estimate.attitude), truth.attitude)
    assert 2.0 * numpy.arccos(min(abs(w), 1.0)) < radians(4.0)


def arrivals(world: World) -> tuple[list[tuple[Instant, Imu]], list[Measurement]]:
    """The IMU of each tick, and everything else in the order of its time."""
    ticks, fixes = [], []
    for truth, arriving in world.flight():
        ticks.append((truth, arriving[-1]))
        fixes += arriving[:-1]
    return ticks, fixes  # type: ignore[return-value]


@pytest.mark.parametrize("world", [World(4, 3.0, rate=30.0), World(5, 3.0, **SKY)], ids=str)
def test_the_order_of_arrival_changes_nothing(world: World) -> None:
    ticks, fixes = arrivals(world)
    fixes = [fix for fix in fixes if fix.time > 0.55 * NS]  # positions begin at rest
    sources = {"source": "mocap" if world.turned else "position"}

    def final(delay: random.Random | None) -> Any:
        part = fusion(**sources)
        waiting = list(fixes)
        first = waiting.pop(0)  # the filter begins at the one that comes first
        late = {f.time: delay.randrange(3 * NS // 10) if delay else 0 for f in waiting}
        for truth, imu in ticks:
            due = [f for f in waiting if f.time + late[f.time] <= truth.time - NS // 1000]
            waiting = [f for f in waiting if f not in due]
            due.sort(key=lambda f: f.time + late[f.time])
            if first.time <= truth.time and truth.time - TICK < first.time:
                due.insert(0, first)
            part.update([*due, imu], truth.time)
        part.update(waiting, ticks[-1][0].time)
        state = part.filter.state
        assert state is not None
        return part.filter.nominal, state.passed, state.covariance.tolist()

    in_order = final(None)
    assert in_order[1] > 0.9 * len(fixes)
    assert all(final(random.Random(seed)) == in_order for seed in range(4))


def test_what_is_older_than_the_memory_is_left_out() -> None:
    ticks, fixes = arrivals(World(4, 3.0))
    old = fixes.pop(6)
    results = []
    for extra in ([], [old]):
        part = fusion(memory=0.3)
        for truth, imu in ticks:
            due = [f for f in fixes if truth.time - TICK < f.time <= truth.time]
            part.update([*due, imu], truth.time)
        assert old.time < ticks[-1][0].time - 0.4 * NS
        results.append(part.update(extra, ticks[-1][0].time))
    assert results[0] == results[1] is not None


def test_what_it_needs_depends_on_its_source() -> None:
    kinds = {
        "mocap": Pose,
        "tags": Frame,
        "position": Position,
    }
    for source, kind in kinds.items():
        params = FusionParams(source=source)  # type: ignore[arg-type]
        assert Fusion.uses(params) == {Imu, kind} < Fusion.needs


def test_it_is_deterministic() -> None:
    first, second = (last(fusion(), World(3, 2.0).flight()) for _ in range(2))
    assert first == second


class Seen(NamedTuple):
    position: Any
    attitude: Any
    covariance: Any


class FakeLocator:
    """Locates by the truth; notes what it was given."""

    given: ClassVar[list[tuple[Sequence[Frame], Any]]]
    sighting = None

    def __init__(self, tags: object, cameras: object, survey: float) -> None:
        type(self).given = []

    def locate(self, frames: Sequence[Frame], prediction: Any) -> Seen | None:
        self.given.append((frames, prediction))
        if len(self.given) % 5 == 0:
            return None
        t = frames[0].time / NS
        return Seen(where(t), attitude(t), numpy.diag([1e-4] * 3 + [1e-4] * 3))


def exact(*_: object) -> tuple[Any, float]:
    """Of a pose that errs by noise alone."""
    return numpy.zeros((6, 7)), 1.0


def test_frames_are_located_where_the_vehicle_was_when_they_were_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("cv2")
    monkeypatch.setattr("kybflow.vision.locating.locator.Locator", FakeLocator)
    monkeypatch.setattr("kybflow.vision.locating.systematic.systematic", exact)
    part = fusion(source="tags", position_noise=0.001, attitude_noise=radians(0.1))
    image = numpy.zeros((4, 4), numpy.uint8)
    for truth, arriving in World(3, 5.0, rate=10.0).flight():
        taken = [m.time for m in arriving if isinstance(m, Pose)]
        frames = [Frame(time, camera, image) for time in taken for camera in ("left", "right")]
        estimate = part.update([*frames, *arriving], truth.time)

    assert estimate is not None
    assert distance(estimate.position, truth.position) < 0.02
    assert len(FakeLocator.given) == 48
    for frames, prediction in FakeLocator.given[10:]:
        assert [frame.camera for frame in frames] == ["left", "right"]
        t = frames[0].time / NS
        assert distance(prediction.position, where(t)) < 4.0 * prediction.spread
        assert distance(prediction.motion.velocity, velocity(t)) < 0.1
        assert 0.0 < prediction.turn < radians(3.0)
