"""autopilot: the newest odometry, moved on to now; what can't be true is left out."""

from __future__ import annotations

from math import inf, nan

import pytest

from kybflow.core.geometry import LEVEL, ZERO, Vec3, from_heading, heading_of
from kybflow.core.signals import NS, Estimate, Imu, Odometry, Pose
from kybflow.parts import Estimator
from kybflow.runtime.estimators.autopilot import AutopilotEstimator, AutopilotEstimatorParams
from kybflow.runtime.estimators.mocap import Mocap
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05,
)  # fmt: skip
MS = NS // 1000


def autopilot(**params) -> AutopilotEstimator:
    return AutopilotEstimator(
        AutopilotEstimatorParams(**params), VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004)
    )


def odometry(
    time: int = 0, position: Vec3 = (1.0, 2.0, 3.0), velocity: Vec3 = (0.5, 0.0, -0.1), **more
) -> Odometry:
    facts = {"attitude": from_heading(0.3), "angular_velocity": (0.0, 0.0, 0.4), "spread": 0.02}
    return Odometry(time, position, velocity, **{**facts, **more})


def known(estimate: Estimate | None) -> Estimate:
    assert estimate is not None
    return estimate


def test_it_says_that_its_estimate_is_the_vehicles_own() -> None:
    assert AutopilotEstimator.needs == {Odometry}
    assert (Estimator.own, Mocap.own, AutopilotEstimator.own) == (False, False, True)


def test_nothing_is_known_before_the_first() -> None:
    pose = Pose(0, ZERO, LEVEL)
    assert autopilot().update([Imu(0, 0.01, ZERO, ZERO), pose], 5) is None


def test_it_is_moved_on_by_its_velocities() -> None:
    estimate = known(autopilot().update([odometry()], 50 * MS))
    assert estimate.time == 50 * MS
    assert estimate.position == pytest.approx((1.025, 2.0, 2.995))
    assert heading_of(estimate.attitude) == pytest.approx(0.32, abs=1e-5)
    assert estimate.velocity == (0.5, 0.0, -0.1)
    assert estimate.angular_velocity == (0.0, 0.0, 0.4)
    assert (estimate.source, estimate.age, estimate.spread) == ("autopilot", 0.05, 0.02)


def test_at_most_so_far_and_its_age_goes_on() -> None:
    estimator = autopilot(ahead=0.1)
    estimator.update([odometry()], 0)
    estimate = known(estimator.update([], 2 * NS))
    assert estimate.position == pytest.approx((1.05, 2.0, 2.99))
    assert estimate.age == 2.0


def test_the_newest_counts_whatever_comes_behind_it() -> None:
    estimator = autopilot()
    late = odometry(30 * MS, (5.0, 0.0, 0.0))
    estimate = known(estimator.update([late, odometry(20 * MS)], 30 * MS))
    assert estimate.position == (5.0, 0.0, 0.0)
    assert known(estimator.update([odometry(30 * MS)], 30 * MS)).position == (5.0, 0.0, 0.0)


def test_one_that_is_stamped_ahead_is_not_moved_back() -> None:
    estimate = known(autopilot().update([odometry(4 * MS)], 0))
    assert (estimate.position, estimate.age) == ((1.0, 2.0, 3.0), 0.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"position": (nan, 0.0, 0.0)},
        {"velocity": (0.0, inf, 0.0)},
        {"angular_velocity": (0.0, 0.0, -inf)},
        {"attitude": (nan, 0.0, 0.0, 0.0)},
        {"attitude": (0.0, 0.0, 0.0, 0.0)},
        {"spread": nan},
        {"spread": -1.0},
    ],
)
def test_what_cannot_be_true_is_left_out(wrong) -> None:
    estimator = autopilot()
    assert estimator.update([odometry(0, **wrong)], 0) is None
    estimator.update([odometry()], 0)
    estimate = known(estimator.update([odometry(10 * MS, **wrong)], 10 * MS))
    assert estimate.age == 0.01
    assert estimate.position == pytest.approx((1.005, 2.0, 2.999))
