"""mocap_frame: hands the finding on in the air, for as long as there is one."""

from __future__ import annotations

import pytest
import short_flights
from part_bench import SITE, estimate, tick
from short_flights import hovers, named

from kybflow.core.signals import Reaction, WrongFrame
from kybflow.runtime.supervisors.mocap_frame import (
    MocapFrameSupervisor,
    MocapFrameSupervisorParams,
)

WRONG = WrongFrame("motion capture shows y mirrored", 2.0, 0.7)


def test_a_wrong_frame_lands_blind_and_is_no_success():
    supervisor = MocapFrameSupervisor(MocapFrameSupervisorParams(), SITE)
    seen = tick(0.0, estimate((0.0, 0.0, 1.0)))
    alarm = supervisor.check(seen._replace(wrong_frame=WRONG), off_ground=True)
    assert alarm is not None
    assert (alarm.event, alarm.reaction) == ("mocap_frame_wrong", Reaction.LAND_BLIND)
    assert (alarm.reason, alarm.value, alarm.bound, alarm.is_failure) == (*WRONG, True)
    assert supervisor.check(seen._replace(wrong_frame=WRONG), off_ground=False) is None
    assert supervisor.check(seen, off_ground=True) is None


def test_poses_that_an_autopilot_rejects_are_told_and_part_of_the_reason():
    supervisor = MocapFrameSupervisor(MocapFrameSupervisorParams(rejected="land"), SITE)
    seen = tick(0.0, estimate((0.0, 0.0, 1.0)))._replace(rejection="its filter rejects the poses")
    alarm = supervisor.check(seen, off_ground=True)
    assert alarm is not None
    assert (alarm.event, alarm.reaction) == ("poses_rejected", Reaction.LAND)
    assert alarm.reason == "its filter rejects the poses"
    assert not alarm.is_failure
    assert supervisor.check(seen, off_ground=False) is None
    alarm = supervisor.check(seen._replace(wrong_frame=WRONG), off_ground=True)
    assert alarm is not None
    assert alarm.event == "mocap_frame_wrong"
    assert alarm.reason == f"{WRONG.reason}; its filter rejects the poses"


def test_a_frame_that_cannot_be_checked_after_the_take_off_lands_blind():
    supervisor = MocapFrameSupervisor(MocapFrameSupervisorParams(), SITE)
    seen = tick(0.0, estimate((0.0, 0.0, 1.0)))._replace(uncompared=1.1)
    alarm = supervisor.check(seen, off_ground=True)
    assert alarm is not None
    assert (alarm.event, alarm.reaction) == ("mocap_frame_unchecked", Reaction.LAND_BLIND)
    assert supervisor.check(seen, off_ground=False) is None
    alarm = supervisor.check(seen._replace(wrong_frame=WRONG), off_ground=True)
    assert alarm is not None
    assert alarm.event == "mocap_frame_wrong"


@pytest.mark.parametrize(
    ("rule", "height", "word"),
    [
        ({"factor": 0.001}, 0.6, "`units`"),
        ({"exchanged": "yz", "mirrored": "y"}, 0.6, "`axes`"),
        ({"mirrored": "y"}, 1.1, "`axes`"),
    ],
)
def test_a_flight_in_a_wrong_frame_ends_low_near_and_gently(run, rule, height, word):
    most, begins = [0.0, 0.0], []

    def look(engine):
        [vehicle] = engine.vehicles
        if vehicle.knowledge.frame.wrong is not None:
            thrust, weight = vehicle.runner.entry().hover_thrust, vehicle.context.airframe
            begins.append(thrust / weight.hover_thrust)
        if vehicle.truth is not None:
            x, y, z = vehicle.truth.position
            most[:] = max(most[0], z), max(most[1], abs(x), abs(y))

    wrong = short_flights.fault("mocap_frame", 0.0, **rule)
    flown, told = run(hovers(2.0, height=1.0), faults=(wrong,), observers=(look,))
    [alarm] = named(told, "mocap_frame_wrong")
    assert word in alarm.fields["reason"]
    assert most[0] <= height
    assert most[1] <= 1.0
    assert set(begins) == {1.0}, "not by what the tracker learnt by wrong positions"
    assert named(told, "landed_hard", "collided") == []
    assert flown.summary["outcome"] == "failed"
    assert alarm.fields["reason"] in flown.summary["reason"]


def test_a_flight_in_the_right_frame_is_told_nothing(run):
    _, told = run(hovers(1.0))
    assert named(told, "mocap_frame_wrong") == []
