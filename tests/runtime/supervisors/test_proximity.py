"""proximity: heard when two vehicles are closer than their airframes allow."""

import pytest
from part_bench import SITE, estimate, tick

from kybflow.core.signals import Alarm, Reaction
from kybflow.runtime.supervisors.proximity import Proximity, ProximityParams

TWO = SITE._replace(diameters={"nano": 0.19, "mk": 0.51})
BOUND = 0.5 * (0.19 + 0.51) + 0.05


def apart(east: float | None, time: float = 0.0):
    here = estimate((0.0, 0.0, 1.0))
    other = None if east is None else estimate((east, 0.0, 1.0))
    return tick(time, here)._replace(fleet={"nano": here, "mk": other})


def test_closer_than_half_of_both_diameters_and_the_margin_it_brakes() -> None:
    alarm = Proximity(ProximityParams(), TWO).check(apart(0.3), off_ground=True)
    assert alarm == Alarm(
        "too_close", Reaction.BRAKE, "0.30 m from `mk`, 0.40 m needed", 0.3, BOUND
    )


def test_a_distance_counts_where_it_is_more_than_the_sizes_ask_for() -> None:
    one_metre = Proximity(ProximityParams(distance=1.0), TWO)
    assert one_metre.check(apart(1.01), off_ground=True) is None
    alarm = one_metre.check(apart(0.99, 0.1), off_ground=True)
    assert alarm is not None
    assert alarm.bound == 1.0
    little = Proximity(ProximityParams(distance=0.1), TWO).check(apart(0.3), off_ground=True)
    assert little is not None
    assert little.bound == BOUND


def test_an_alarm_lasts_until_they_are_well_apart() -> None:
    supervisor = Proximity(ProximityParams(), TWO)
    ways = enumerate((0.41, 0.38, 0.42, 0.46, 0.41))
    heard = [supervisor.check(apart(x, 0.1 * i), True) is not None for i, x in ways]
    assert heard == [False, True, True, False, False]


def test_alone_on_the_ground_or_beside_one_that_nobody_sees_it_is_silent() -> None:
    supervisor = Proximity(ProximityParams(), TWO)
    assert supervisor.check(apart(None), off_ground=True) is None
    assert supervisor.check(apart(0.1), off_ground=False) is None
    assert supervisor.check(tick(known=estimate((0.0, 0.0, 1.0))), off_ground=True) is None


def test_far_apart_it_looks_no_more_often_than_it_must() -> None:
    supervisor = Proximity(ProximityParams(), TWO)
    assert supervisor.check(apart(1.4), off_ground=True) is None
    assert supervisor.check(apart(0.1, 0.049), off_ground=True) is None
    assert supervisor.check(apart(0.1, 0.051), off_ground=True) is not None


def test_it_declares_the_distance_that_it_alarms_below() -> None:
    assert Proximity.keeps_apart(ProximityParams(), 0.4, 0.2) == pytest.approx(0.35)
    assert Proximity.keeps_apart(ProximityParams(distance=0.6), 0.4, 0.2) == pytest.approx(0.6)
