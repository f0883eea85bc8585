"""A command as fractions, in the drone's own directions."""

from __future__ import annotations

from math import pi

import pytest

from kybflow.core.geometry import from_euler, from_heading, multiply
from kybflow.core.signals import Command, CommandKind, Setpoint, SetpointKind
from kybflow.drivers.ardrone.flight import move_of
from kybflow.drivers.ardrone.params import Limits

LIMITS = Limits(0.2, 0.7, 1.75)


def command(roll=0.0, pitch=0.0, heading=0.0, climb=0.0, turn=0.0):
    setpoint = Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, climb))
    attitude, rates = from_euler(roll, pitch, heading), (0.0, 0.0, turn)
    return Command(attitude, 4.1, rates, heading, True, CommandKind.TILT_CLIMB, setpoint)


@pytest.mark.parametrize("heading", [0.0, pi / 2, -2.5])
def test_signs_are_the_drones(heading):
    move = move_of(command(roll=0.1, pitch=0.05, heading=heading, climb=0.35, turn=0.875), LIMITS)
    assert move.right == pytest.approx(0.5)
    assert move.backward == pytest.approx(-0.25, abs=1e-2)  # nose down goes forward
    assert move.up == pytest.approx(0.5)
    assert move.clockwise == pytest.approx(-0.5)  # to the left is anticlockwise


def test_no_more_than_all_is_asked_for():
    move = move_of(command(roll=-1.0, pitch=1.0, climb=-5.0, turn=-9.0), LIMITS)
    assert move == (-1.0, -1.0, -1.0, 1.0, True)


@pytest.mark.parametrize("heading", [0.0, pi / 2, -2.5])
def test_by_the_compass_the_world_s_axis_is_ahead(heading):
    toward_x = multiply(from_euler(0.0, 0.1, 0.0), from_heading(heading))
    told = command()._replace(attitude=toward_x, heading=heading)
    move = move_of(told, LIMITS, by_compass=True)
    assert (move.right, move.backward) == pytest.approx((0.0, -0.5), abs=1e-6)
