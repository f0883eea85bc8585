"""What is known of a payload and of the accelerometer's bias, and what a servo is asked for."""

from __future__ import annotations

from math import nan

import pytest
from part_bench import estimate
from plans import part, state, then, vehicle
from short_flights import down, hold, up

from kybflow.core.geometry import GRAVITY, ZERO
from kybflow.core.signals import NS, Event, Imu, Payload, PayloadState
from kybflow.dsl.plan import EstimatorPlan, TransitionPlan
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.knowledge import REST_TIME_S, PayloadTracker, RestingBias

CLOSED, OPEN = Payload(0, False, True), Payload(0, True, False)
BLIND_CLOSED, BLIND_OPEN = Payload(0, False, None), Payload(0, True, None)


def cargo(*said: Payload) -> tuple[PayloadTracker, list[Event]]:
    told: list[Event] = []
    made = PayloadTracker("a", Events([told.append]))
    for word in said:
        made.update(word, None, 0)
    return made, told


def test_nothing_is_known_before_the_vehicle_says_something() -> None:
    made, told = cargo()
    assert (made.state, made.releases, told) == (None, 0, [])


def test_what_was_on_board_and_is_let_go_is_released_and_told_with_its_place() -> None:
    made, told = cargo(CLOSED)
    assert made.state is PayloadState.ABOARD
    assert made.wants(True, 2 * NS, "m.yaml:7")
    assert made.wants(True, 2 * NS + 1, "m.yaml:7")
    made.update(OPEN, estimate((1.0, 2.0, 3.0)), 2 * NS + NS // 2)
    assert (made.state, made.releases) == (PayloadState.RELEASED, 1)
    [event] = told
    assert (event.name, event.vehicle) == ("payload_released", "a")
    assert event.fields == {"x": 1.0, "y": 2.0, "z": 3.0, "took": 0.5}


def test_it_is_not_released_again_and_who_asks_is_told() -> None:
    made, told = cargo(CLOSED, OPEN)
    assert not made.wants(True, NS, "m.yaml:9")
    made.update(OPEN, None, NS)
    assert made.releases == 1
    assert [(e.name, e.at) for e in told[1:]] == [("payload_already_released", "m.yaml:9")]


def test_a_release_that_was_acknowledged_too_late_counts_too() -> None:
    made, _ = cargo(BLIND_CLOSED)
    made.wants(True, NS, "")
    made.update(BLIND_OPEN, None, 9 * NS)
    assert (made.state, made.releases) == (PayloadState.RELEASED, 1)


def test_loaded_anew_it_may_be_released_anew() -> None:
    made, told = cargo(CLOSED, OPEN)
    assert made.wants(False, NS, "")
    made.update(CLOSED, None, NS)
    assert made.state is PayloadState.ABOARD
    assert made.wants(True, 2 * NS, "")
    made.update(OPEN, None, 2 * NS)
    assert made.releases == 2
    assert [e.name for e in told] == ["payload_released", "payload_loaded", "payload_released"]


def test_a_vehicle_that_can_not_tell_what_it_carries_is_not_believed_to_carry_something() -> None:
    made, _ = cargo(BLIND_CLOSED)
    assert made.state is None
    assert cargo(BLIND_OPEN)[0].state is PayloadState.ABSENT
    assert cargo(OPEN)[0].state is PayloadState.ABSENT
    assert cargo(Payload(0, False, False))[0].state is PayloadState.ABSENT


def test_an_open_servo_with_the_payload_still_there_has_released_nothing() -> None:
    made, told = cargo(CLOSED)
    made.wants(True, NS, "")
    made.update(Payload(NS, True, True), None, NS)
    assert (made.state, made.releases, told) == (PayloadState.ABOARD, 0, [])


def test_a_servo_is_not_asked_for_what_it_does_already() -> None:
    made, _ = cargo(BLIND_CLOSED)
    assert not made.wants(False, NS, "")
    assert made.wants(True, NS, "")


def rest(lift: float, seconds: float) -> RestingBias:
    felt = RestingBias()
    for step in range(round(seconds / 0.004)):
        felt.add(Imu(step, 0.004, (0.0, 0.0, lift), ZERO))
    return felt


@pytest.mark.parametrize("lift", [GRAVITY - 1.0, GRAVITY, GRAVITY + 0.4])
def test_it_is_what_was_felt_on_average(lift: float) -> None:
    assert rest(lift, 0.2).specific_force == pytest.approx(lift)


def test_a_moment_tells_nothing() -> None:
    brief = rest(9.0, REST_TIME_S / 2)
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
    assert REST_TIME_S <= started.time / NS <= REST_TIME_S + 0.05
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
