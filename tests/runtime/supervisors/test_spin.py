"""spin: heard when a vehicle turns faster than it is asked to, for as long as it flies."""

from math import radians

import pytest
from part_bench import SITE, estimate, tick

from kybflow.core.signals import Reaction, Setpoint, SetpointKind
from kybflow.runtime.supervisors.spin import Spin, SpinParams

PERIOD = 0.02


def heard(rates, asked=0.0, off_ground=True, supervisor=None, age=0.0):
    """The alarm after these turn rates, deg/s, one a look."""
    supervisor, alarm = supervisor or Spin(SpinParams(), SITE), None
    for look, rate in enumerate(rates):
        known = estimate((0.0, 0.0, 1.0), age=age)._replace(
            angular_velocity=(0.0, 0.0, radians(rate))
        )
        wanted = Setpoint(SetpointKind.POSITION, heading_rate=asked)
        alarm = supervisor.check(tick(look * PERIOD, known, wanted), off_ground)
    return alarm


@pytest.mark.parametrize("rate", [720.0, -720.0])
def test_a_vehicle_that_spins_lands(rate):
    alarm = heard([rate] * 20)
    assert alarm is not None
    assert (alarm.event, alarm.reaction) == ("spinning", Reaction.LAND)
    assert alarm.reason.endswith("360 deg/s allowed")


def test_noise_and_a_quick_turn_are_no_spin():
    assert heard([800.0, -800.0] * 20) is None
    assert heard([215.0] * 50) is None


def test_a_turn_that_is_asked_for_is_no_spin():
    assert heard([720.0] * 50, asked=radians(720.0)) is None


def test_how_the_vehicle_turned_long_ago_does_not_count():
    assert heard([720.0] * 50, age=0.11) is None


def test_it_lasts_until_the_vehicle_is_down():
    supervisor = Spin(SpinParams(), SITE)
    assert heard([720.0] * 20, supervisor=supervisor) is not None
    assert heard([0.0] * 50, supervisor=supervisor) is not None
    assert heard([720.0] * 50, off_ground=False, supervisor=supervisor) is None
