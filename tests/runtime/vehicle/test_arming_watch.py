"""A vehicle that reports itself disarmed in the air, or armed though it has landed."""

from __future__ import annotations

import pytest
from plans import wrapped
from short_flights import named, path
from test_override import TAKEN, Autopilot, flight

from kybflow.core.errors import Refused
from kybflow.core.signals import NS
from kybflow.parts import Override

FALLS = 0.45
"""Seconds from its height to the floor."""


class Dropped(Autopilot):
    """Its rotors stop in flight."""

    def read(self, now):
        late = FALLS + 0.2 if self.way == "says it late" else 0.0
        if now / NS >= TAKEN + late and self.armed:
            self.armed = False
            if self.way == "says so":
                self.override = Override("it disarmed in the air")
        if now / NS >= TAKEN and self._last is not None:
            self.link.send(self._last._replace(armed=False, thrust=0.0), now)
        return self.link.read(now)

    def send(self, command, now):
        if now / NS < TAKEN:
            super().send(command, now)


@pytest.mark.parametrize(
    "way",
    [
        "says so",
        *(pytest.param(w, marks=pytest.mark.thorough) for w in ("says it late", "says nothing")),
    ],
)
def test_one_that_disarms_in_the_air_has_not_landed(run, way):
    own = wrapped(lambda _, link: Dropped(link, way))
    flown, told = run(flight(own))
    [lost], started = named(told, "control_lost"), named(told, "failsafe_started")[-1]
    assert lost.fields["reason"].startswith("it disarmed in the air: its estimated height ")
    assert TAKEN < lost.time / NS < TAKEN + (0.75 if way == "says it late" else 0.3)
    assert started.fields["reaction"] == "cut"
    assert named(told, "landed") == []
    states = path(told, "a")
    assert (states[:2], states[-1]) == (["up", "hold"], "fault")
    assert "it disarmed in the air" in flown.summary["reason"]
    assert flown.summary["sim_time_s"] > TAKEN + 2.0
    assert flown.exit_code == 1


class Stubborn(Autopilot):
    """It stays armed after its landing, until it is forced to disarm, or longer."""

    forced: float | None = None

    def send(self, command, now):
        super().send(command, now)
        self.armed = self.forced is None

    def disarm_by_force(self, now):
        if self.way == "flies":
            raise Refused("it says that it is in the air")
        self.forced = self.forced or now / NS


@pytest.mark.thorough
def test_one_that_stays_armed_after_its_landing_is_disarmed_by_force(run):
    opened: list[Stubborn] = []

    def wrap(_, link):
        opened.append(Stubborn(link, "lands"))
        return opened[0]

    flown, told = run(flight(wrapped(wrap), 1.0))
    [landed], said = named(told, "landed"), named(told, "stays_armed")
    after = [(event.time - landed.time) / NS for event in said]
    assert after == pytest.approx([5.0, 10.0], abs=0.05)
    assert said[1].fields == {"reason": "it stands still on the ground: disarmed by force"}
    assert opened[0].forced == pytest.approx(said[1].time / NS)
    assert flown.exit_code == 0


@pytest.mark.thorough
def test_a_run_ends_with_the_truth_where_force_does_not_help(run):
    own = wrapped(lambda _, link: Stubborn(link, "flies"))
    flown, told = run(flight(own, 1.0))
    [landed], said = named(told, "landed"), named(told, "stays_armed")
    assert [event.fields["reason"] for event in said[1:]] == [
        "it can't be disarmed by force: it says that it is in the air",
        "it has landed, and is still armed after 30 s: disarm it",
    ]
    assert "still armed after 30 s" in flown.summary["reason"]
    assert flown.summary["sim_time_s"] == pytest.approx(landed.time / NS + 30.0, abs=1.0)
    assert flown.exit_code == 1
