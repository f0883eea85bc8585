"""The share of the throttle that holds a vehicle in the air."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from scripted_autopilot import RESTING, at

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NS, CommandKind, Odometry
from kybflow.drivers.mavlink.control.hover_throttle import HoverThrottle

TOLD = {"MPC_THR_HOVER": 0.4}
STILL = Odometry(0, ZERO, ZERO, LEVEL, ZERO, 0.1)
FAST = STILL._replace(velocity=(1.0, 0.0, 0.0))


def learned(asked=0.6, command=None, odometry=STILL, seconds=30):
    hover = HoverThrottle("MPC_THR_HOVER", 10.0, False)
    for tick in range(seconds * 50):
        hover.learn(asked, command or at(ZERO), odometry, TOLD, tick * NS // 50)
    return hover.throttle(TOLD).hover


def test_first_its_own_parameter_counts_then_a_half():
    assert HoverThrottle("MPC_THR_HOVER", 10.0, False).throttle(TOLD).share(10.0) == 0.4
    assert HoverThrottle("MPC_THR_HOVER", 10.0, False).throttle({}).share(5.0) == 0.25


def test_what_its_controller_asks_for_in_hover_is_learned_slowly():
    assert learned() == pytest.approx(0.6, abs=0.01)
    assert learned(seconds=1) == pytest.approx(0.4, abs=0.05)
    pushed = at(ZERO)._replace(kind=CommandKind.ACCELERATION)
    assert learned(command=pushed) == pytest.approx(0.6, abs=0.01)


def test_nothing_is_learned_on_the_move_or_while_thrust_is_commanded():
    assert learned(odometry=FAST) == 0.4
    assert learned(odometry=None) == 0.4
    assert learned(command=RESTING) == 0.4
    assert learned(asked=None) == 0.4


def test_it_stays_within_reason():
    assert learned(asked=0.0, seconds=100) == 0.1
    assert learned(asked=1.0, seconds=100) == 0.9
