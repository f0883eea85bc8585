"""tilt: heard beyond the limit, with hysteresis."""

from math import radians

import pytest
from part_bench import SITE, estimate, tick

from kybflow.core.geometry import from_euler
from kybflow.core.signals import Alarm, Reaction
from kybflow.runtime.supervisors.tilt import TiltSupervisor, TiltSupervisorParams


def at(degrees: float):
    attitude = from_euler(radians(degrees), 0.0, 0.0)
    return tick(known=estimate((0.0, 0.0, 1.0))._replace(attitude=attitude))


def test_beyond_the_limit_it_asks_to_land_blind() -> None:
    alarm = TiltSupervisor(TiltSupervisorParams(), SITE).check(at(70.0), off_ground=True)
    reason = "tilted by 70 deg, 60 deg allowed"
    expected = Alarm("tilted", Reaction.LAND_BLIND, reason, radians(70.0), radians(60.0))
    assert alarm is not None
    assert alarm._replace(value=pytest.approx(alarm.value)) == expected


def test_an_alarm_lasts_until_the_vehicle_is_well_below_the_limit() -> None:
    supervisor = TiltSupervisor(TiltSupervisorParams(), SITE)
    heard = [supervisor.check(at(a), True) is not None for a in (59, 61, 56, 54, 59)]
    assert heard == [False, True, True, False, False]


def test_on_the_ground_and_without_an_estimate_it_is_silent() -> None:
    assert TiltSupervisor(TiltSupervisorParams(), SITE).check(at(90.0), off_ground=False) is None
    assert TiltSupervisor(TiltSupervisorParams(), SITE).check(tick(), off_ground=True) is None


def test_how_the_vehicle_was_tilted_long_ago_is_not_judged() -> None:
    supervisor = TiltSupervisor(TiltSupervisorParams(), SITE)
    heard = [
        supervisor.check(seen._replace(estimate=seen.estimate._replace(age=age)), True) is not None
        for age in (0.02, 0.11, 0.3)
        for seen in [at(70.0)]
    ]
    assert heard == [True, False, False]
