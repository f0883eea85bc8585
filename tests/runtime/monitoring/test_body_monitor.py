"""Bodies of motion capture in flight: what is told of them, and what is flown on meanwhile."""

from __future__ import annotations

import pytest
from plans import part, vehicle
from short_flights import down, hold, named, path, up

from kybflow.core.units import DURATION
from kybflow.dsl.expressions import Compare, Quantity, Read
from kybflow.dsl.plan import EstimatorPlan, FaultPlan

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


def test_noiseless_motion_capture_is_never_frozen(run):
    quiet = part("drivers", "sim", mocap_position_noise=0.0, mocap_attitude_noise=0.0)
    flown, told = run(flier(driver=quiet))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    assert bodies(told) == []


@pytest.mark.parametrize(
    ("name", "event"), [("mocap_frozen", "body_froze"), ("mocap_dropout", "body_lost")]
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
    assert "from where it is believed" in refused.fields["reason"]
    assert accepted.fields["value"] == pytest.approx(0.3, abs=0.02)
    [*_, back] = named(told, "estimator_changed")
    assert back.fields["estimator"] == "mocap"
    assert back.time - accepted.time < 50_000_000


def test_a_body_that_jumps_is_told_and_the_vehicle_ends_on_the_ground(run):
    _, told = run(flier(estimators=FALLBACK), faults=(fault("mocap_jump", None),))
    assert bodies(told)[0] == ("a", "body_jumped")
    [jump, *_] = named(told, "body_jumped")
    assert jump.fields["value"] == pytest.approx(1.0, abs=0.05)
    assert named(told, "landed")


def test_two_bodies_that_are_exchanged_are_told_with_their_names(run):
    two = (flier("a"), flier("b", start=(0.6, 0.0, 0.0)))
    _, told = run(*two, faults=(fault("mocap_swap", None, other="b"),))
    found = {(e.vehicle, e.fields["other"]) for e in named(told, "body_swapped")}
    assert found == {("a", "b"), ("b", "a")}
    assert {e.vehicle for e in named(told, "landed")} == {"a", "b"}
