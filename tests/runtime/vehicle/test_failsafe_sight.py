"""A vehicle that lands blind lands by its estimate once nothing speaks against it."""

from __future__ import annotations

import pytest
from part_bench import estimate
from short_flights import NoParams

from kybflow.core.signals import NS, Alarm, Event, Reaction, Tick
from kybflow.parts import Supervisor
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.failsafe import SIGHT_TIME_NS, Failsafe, RaisedAlarm

LOST = Alarm("estimate_lost", Reaction.LAND_BLIND, "none")
TILTED = Alarm("tilted", Reaction.LAND_BLIND, "80 deg")
LOW = Alarm("battery_low", Reaction.LAND, "9 %")


def tick(now: int, known: bool = True) -> Tick:
    here = estimate((0.0, 0.0, 1.0)) if known else None
    return Tick(now, 0.004, 0.0, here, None, None, {})


@pytest.fixture
def told() -> list[Event]:
    return []


@pytest.fixture
def failsafe(told: list[Event]) -> Failsafe:
    return Failsafe("a", {}, {}, Events((told.append,)))


def decide(failsafe: Failsafe, alarm: Alarm, now: int, known: bool = False) -> Reaction | None:
    return failsafe.decide(RaisedAlarm(alarm, ""), tick(now, known), True, "hold")


@pytest.mark.parametrize("alarm", [LOST, LOW])
def test_half_a_second_with_an_estimate_is_enough(
    failsafe: Failsafe, told: list[Event], alarm: Alarm
) -> None:
    assert decide(failsafe, alarm, NS) is Reaction.LAND_BLIND
    assert not failsafe.sees_again(tick(2 * NS, known=False))
    assert not failsafe.sees_again(tick(2 * NS + SIGHT_TIME_NS - 1))
    assert failsafe.sees_again(tick(2 * NS + SIGHT_TIME_NS))
    assert failsafe.latched is Reaction.LAND
    assert told[-1].fields["reason"] == "there is an estimate, and no alarm, for 0.5 s"
    assert not failsafe.sees_again(tick(9 * NS))
    assert decide(failsafe, LOST, 9 * NS) is Reaction.LAND_BLIND


def test_an_alarm_of_the_estimate_begins_the_wait_anew(failsafe: Failsafe) -> None:
    decide(failsafe, LOST, NS)
    assert decide(failsafe, LOST, 2 * NS, known=True) is None
    assert not failsafe.sees_again(tick(2 * NS + SIGHT_TIME_NS - 1))
    assert failsafe.sees_again(tick(2 * NS + SIGHT_TIME_NS))


def test_an_alarm_that_is_over_keeps_nobody_blind(failsafe: Failsafe) -> None:
    assert decide(failsafe, TILTED, NS, known=True) is Reaction.LAND_BLIND
    assert decide(failsafe, TILTED, 2 * NS, known=True) is None
    assert not failsafe.sees_again(tick(2 * NS + SIGHT_TIME_NS - 1))
    assert failsafe.sees_again(tick(2 * NS + SIGHT_TIME_NS))


def test_a_landing_that_failed_stays_blind(failsafe: Failsafe) -> None:
    failed = Alarm("part_failed", Reaction.LAND_BLIND, "`land` failed")
    assert decide(failsafe, failed, NS, known=True) is Reaction.LAND_BLIND
    assert not failsafe.sees_again(tick(9 * NS))


class Alarming(Supervisor[NoParams]):
    always = True
    events = ()

    def __init__(self, alarm: Alarm) -> None:
        self._alarm = alarm

    def check(self, tick: Tick, off_ground: bool) -> Alarm:
        return self._alarm


def test_the_lateness_of_an_alarm_that_is_not_the_severest_counts() -> None:
    late = Alarm("commands_late", Reaction.LAND, "80 ms", late=0.08)
    supervisors = {"late": Alarming(late), "tilt": Alarming(TILTED)}
    raised = Failsafe("a", supervisors, {}, Events()).check(tick(NS), True)
    assert raised is not None
    assert raised.alarm == TILTED._replace(late=0.08)
