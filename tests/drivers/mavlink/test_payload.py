"""The output that holds the payload."""

from __future__ import annotations

import pytest
from framing import FAILED, GRIPPER, SERVO, UNSUPPORTED
from scripted_autopilot import Bench, standing

from kybflow.core.errors import Refused
from kybflow.core.signals import Payload
from kybflow.world.vehicle_context import Parcel

CARRIED = Parcel(mass=0.2, size=0.1, channel=1, aboard=True)


def bench(name="ardupilot", function=0.0, **params):
    made = Bench(name, payload=CARRIED, **params)
    made.fake.params[made.fake.profile.output(1, False).parameter] = function
    made.run(3.0)
    return made


def grip(made, is_open, seconds=10.0):
    """What it told of its payload first within that time."""
    made.measured.clear()
    for _ in range(round(seconds * 50)):
        made.link.grip(is_open, made.now)
        made.tick()
        if told := [m for m in made.measured if isinstance(m, Payload)]:
            return told[0]
    return None


def test_what_was_aboard_at_the_start_is_told_first():
    made = bench()
    assert made.measured[0] == Payload(0, False, True)


def test_a_servo_opens_and_is_seen_to():
    made = bench()
    told = grip(made, True)
    assert (told.is_open, told.aboard) == (True, None)
    assert [m.param2 for m in made.fake.commands(SERVO)] == [1100.0]
    assert grip(made, False).is_open is False
    assert made.fake.servos[8] == 1900


def test_an_acknowledgement_that_moves_nothing_is_refused_with_what_to_look_at():
    made = bench()
    made.fake.obeys = False
    with pytest.raises(Refused, match=r"output 9 does not move.*SERVO9_FUNCTION"):
        grip(made, True)


def test_where_nobody_knows_what_the_output_is_for_the_next_way_is_tried():
    made = bench()
    made.link.autopilot.parameters.values.clear()
    made.fake.refuses[SERVO] = (UNSUPPORTED, "")
    made.fake.refuses[GRIPPER] = (FAILED, "No gripper")
    with pytest.raises(Refused, match=r"DO_SET_SERVO.*UNSUPPORTED.*; DO_GRIPPER.*No gripper"):
        grip(made, True)


def test_an_output_that_is_for_something_else_is_not_moved():
    made = bench(function=33.0)
    with pytest.raises(Refused, match="SERVO9_FUNCTION is 33"):
        grip(made, True)
    assert made.fake.commands(SERVO) == []


def test_a_lost_answer_is_asked_for_again():
    made = bench()
    made.fake.deaf_to.add(SERVO)
    assert grip(made, True, 8.0) is None
    made.fake.deaf_to.clear()
    assert grip(made, True) is not None


def test_one_that_carries_nothing_has_nothing_to_open():
    made = standing("ardupilot")
    with pytest.raises(Refused, match="carries no payload"):
        made.link.grip(True, made.now)
