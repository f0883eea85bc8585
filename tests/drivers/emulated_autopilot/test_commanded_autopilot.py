"""A person commands a vehicle on an emulated autopilot, and a pilot takes it over in between."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from commanders import Asked, People
from dry_runs import AUTOPILOTS, opening
from plans import part, plan, state, vehicle
from short_flights import down, hold, named, path, up

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS
from kybflow.dsl.plan import TransitionPlan

PILOT = {"px4": ("POSCTL", "POSITION"), "ardupilot": ("LOITER", "LOITER")}
"""The pilot's mode as the emulated firmware and as the driver call it."""
TAKEN = 17.0
SOMEBODYS = "somebody else has control, until `operator.resume`"


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_person_starts_pauses_takes_back_and_lands_it(autopilot, tmp_path):
    own, opened = opening(autopilot)
    go = TransitionPlan(target="up", event="operator.go")
    idle = state("idle", part("behaviors", "wait_on_ground"), go)
    states = [idle, up("hold", 0.6), hold(60.0, "down"), down()]
    one = vehicle("a", states, driver=own, tracker=part("trackers", "on_board"))
    people = People(
        Asked(5.0, "emit operator.go"), Asked(14.0, "pause"), Asked(15.0, "resume"),
        Asked(TAKEN + 1.0, "switch a down"), Asked(TAKEN + 1.5, "land"),
        Asked(TAKEN + 2.0, "resume a"), Asked(TAKEN + 6.0, "land"),
    )  # fmt: skip

    def pilots(engine):
        if engine.seconds() >= TAKEN and not given:
            given.append(opened[0].links["a"].onboard.give_to_pilot(PILOT[autopilot][0]))

    given, told = [], []
    request = RunRequest(out=tmp_path / "run")
    observers = (people.look, pilots)
    flown = fly(plan(one, time_limit=90.0), request, (told.append,), observers, (people.serve,))
    assert people.answers == [
        ("emit operator.go", True, ""), ("pause", True, ""), ("resume", True, ""),
        ("switch a down", False, SOMEBODYS), ("land", False, SOMEBODYS),
        ("resume a", True, ""), ("land", True, ""),
    ]  # fmt: skip
    [taken], [back] = named(told, "control_taken"), named(told, "control_returned")
    assert taken.fields["reason"] == f"a pilot took over: {PILOT[autopilot][1]}"
    assert 0.0 <= back.time / NS - TAKEN - 2.0 < 1.5
    assert path(told, "a") == ["idle", "up", "hold", "auto_land", "landed"]
    assert named(told, "foreign_command") == []
    assert flown.exit_code == 0
