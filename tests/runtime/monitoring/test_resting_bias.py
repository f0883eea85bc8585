"""What the IMU feels at rest: known after a while on the ground, and no longer than the rotors
rest."""

from __future__ import annotations

from math import nan

import pytest
from plans import part, state, then, vehicle
from short_flights import down, hold, up

from kybflow.core.geometry import GRAVITY, ZERO
from kybflow.core.signals import NS, Imu
from kybflow.dsl.plan import EstimatorPlan, TransitionPlan
from kybflow.runtime.vehicle.knowledge import LONG, RestingBias


def rest(lift: float, seconds: float) -> RestingBias:
    felt = RestingBias()
    for step in range(round(seconds / 0.004)):
        felt.add(Imu(step, 0.004, (0.0, 0.0, lift), ZERO))
    return felt


@pytest.mark.parametrize("lift", [GRAVITY - 1.0, GRAVITY, GRAVITY + 0.4])
def test_it_is_what_was_felt_on_average(lift: float) -> None:
    assert rest(lift, 0.2).specific_force == pytest.approx(lift)


def test_a_moment_tells_nothing() -> None:
    brief = rest(9.0, LONG / 2)
    assert (brief.is_known, brief.specific_force) == (False, GRAVITY)
    assert RestingBias().specific_force == GRAVITY


@pytest.mark.parametrize("lift", [0.0, 7.0, 12.0, nan])
def test_what_no_accelerometer_is_wrong_by_is_not_believed(lift: float) -> None:
    assert rest(lift, 0.2).specific_force == GRAVITY


def test_a_sample_counts_as_long_as_it_lasted() -> None:
    felt = RestingBias()
    felt.add(Imu(0, 0.3, (0.0, 0.0, 9.0), ZERO))
    felt.add(Imu(1, 0.1, (0.0, 0.0, 10.0), ZERO))
    assert felt.specific_force == pytest.approx(9.25)


def test_a_flight_learns_it_before_take_off_and_anew_after_each_landing(run) -> None:
    seen = {}

    def look(engine):
        one = engine.vehicles[0]
        if not engine.flying:
            return
        seen.setdefault((one.state, one.link_out.sent.armed), []).append(
            one.knowledge.resting.specific_force
        )

    inertial = tuple(
        EstimatorPlan(part("estimators", name), recover_after=1.0) for name in ("mocap", "inertial")
    )
    landing = state("down", part("behaviors", "land"), then("wait"))
    waiting = part("behaviors", "wait_on_ground")
    wait = state("wait", waiting, TransitionPlan(target="landed", after=0.5))
    states = [up("hold"), hold(1.0, "down"), landing, wait]
    _, told = run(vehicle("a", states, estimators=inertial), observers=(look,))
    started = next(e for e in told if e.name == "behavior_started")
    assert LONG <= started.time / NS <= LONG + 0.05
    [airborne] = {lift for state in ("up", "hold") for lift in seen[state, True]}
    assert 0.0 < abs(airborne - GRAVITY) < 0.3
    assert airborne not in seen["wait", False]
    assert seen["wait", False][-1] == pytest.approx(airborne, abs=0.15)


def test_without_an_imu_on_the_ground_it_is_gravity(run) -> None:
    seen = set()
    run(
        vehicle("a", [up("down"), down()]),
        observers=(lambda engine: seen.add(engine.vehicles[0].knowledge.resting.specific_force),),
    )
    assert seen == {GRAVITY}
