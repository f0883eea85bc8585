"""A person at the run's terminal: a mission that waits, and a pilot's take-over that is over."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from dry_runs import AUTOPILOTS, HEIGHT, DryRun
from fingers import Person
from plans import part, state
from short_flights import down, hold, up

from kybflow.dsl.plan import TransitionPlan

PILOTS_MODE = {"px4": "POSCTL", "ardupilot": "LOITER"}
GO, TAKEN, BACK = 3.0, 9.0, 11.0
"""Seconds: of `operator.go`, of the pilot's take-over, and of `resume`."""


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_person_lets_it_go_and_asks_it_back_from_a_pilot(autopilot, tmp_path):
    person, offered = Person(), []

    def takes_over(flight):
        flight.pilot.give_to_pilot(PILOTS_MODE[autopilot])

    def asks_back(flight):
        person.see(flight.engine)
        offered.extend(offer.name for offer in person.commander.offers)
        person.press(flight.engine, "resume", "enter")

    go = TransitionPlan(target="up", event="operator.go")
    idle = state("idle", part("behaviors", "wait_on_ground"), go)
    flight = DryRun(
        autopilot,
        tmp_path,
        states=[idle, up("hold", HEIGHT), hold(5.0, "down"), down()],
        deeds=[
            (GO, lambda flight: person.press(flight.engine, "operator.go", "enter")),
            (TAKEN, takes_over),
            (BACK, asks_back),
        ],
        servers=(person.commander.serve,),
    )
    assert 0.0 <= flight.at("control_taken") - TAKEN < 0.1
    assert offered == ["pause", "resume", "stop"]
    assert 0.0 <= flight.at("control_returned") - BACK < 1.5
    assert flight.path == ["idle", "up", "hold", "down", "landed"]
    assert [e.fields["command"] for e in flight.events("command_given")] == [
        "emit operator.go",
        "resume",
    ]
    assert flight.flown.exit_code == 0
    assert flight.is_safe()
