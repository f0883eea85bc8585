"""Nobody has landed in the air: not who stands still at the top of a climb, nor who says so."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fault_study import plan_of
from plans import failed, part, state, then, vehicle
from short_flights import NoParams, down, fault, named, path, up
from toolchain import flight_of

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NS, Command, CommandKind, Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import DURATION, LENGTH
from kybflow.dsl.expressions import And, Compare, InState, Quantity, Read
from kybflow.dsl.plan import FaultPlan, TransitionPlan
from kybflow.flight.motion import IDLE
from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry

LOW = 0.06
"""Metres; the rotors may stop up to here."""


class Watch:
    """The true heights at which the rotors of `name` were told to stop after they had turned, and
    the greatest height of all."""

    def __init__(self, name: str) -> None:
        self.stopped: list[float] = []
        self.top = 0.0
        self._name, self._turned = name, False

    def __call__(self, engine) -> None:
        if not engine.flying:
            return
        flying = next(v for v in engine.vehicles if v.name == self._name)
        height, turns = flying.truth.position[2], flying.airborne
        self.top = max(self.top, height)
        if self._turned and not turns:
            self.stopped.append(height)
        self._turned = turns


@pytest.fixture(autouse=True)
def _every_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kybflow.runtime.engine._OBSERVED_EVERY", 1)


def touch_down(mission: str, seed: int, tmp_path, *faults: FaultPlan):
    plan, watch = plan_of(mission), Watch("nano")
    fliers = (replace(v, tracker=part("trackers", "cascade")) for v in plan.vehicles)
    plan = replace(plan, vehicles=tuple(fliers), faults=faults)
    flight, told = flight_of(plan, tmp_path / "run", watch, seed=seed)
    return flight.summary, told, watch


@pytest.mark.thorough
def test_a_link_cut_and_a_weak_battery_in_a_landing_end_on_the_floor(tmp_path):
    late = Compare(">", Read("nano", "elapsed"), Quantity(2.63, DURATION))
    when = And((InState("nano", "down"), late))
    cut = fault("link_cut", when=when, lasts=2.4, on="nano", way="to_vehicle")
    sag = fault("battery_sag", when=when, lasts=1.3, on="nano", by=0.97)
    summary, told, watch = touch_down("figure_eight", 93537, tmp_path, cut, sag)
    assert watch.top < 1.1
    assert all(height < LOW for height in watch.stopped)
    assert len(named(told, "landed")) == 2
    assert summary["vehicles"]["nano"]["final"] == "ground"


def test_a_vehicle_that_has_lost_half_its_mass_lands_on_the_floor(tmp_path):
    low = Compare("<", Read("nano", "state.altitude"), Quantity(0.04, LENGTH))
    when = And((InState("nano", "down"), low))
    light = fault("mass_change", when=when, lasts=1.43, on="nano", factor=0.57)
    summary, told, watch = touch_down("first_flight", 35303, tmp_path, light)
    [height] = watch.stopped
    assert height < LOW
    assert "above the ground" in named(told, "landing_refused")[0].fields["reason"]
    assert summary["outcome"] == "succeeded"


WAYS = (AIR >> GROUND, MOVING >> GROUND)


class Boasting(Behavior[NoParams], flight=WAYS, emits=SetpointKind.POSITION):
    """A lab's own landing, which says at once that it has landed."""

    def update(self, tick: Tick) -> Setpoint | Done:
        return Done(IDLE)


@pytest.mark.thorough
def test_a_behavior_that_says_so_in_the_air_has_not_landed(run):
    watch = Watch("a")
    boast = state("boast", Boasting, then("landed"), failed("auto_land"))
    _, told = run(vehicle("a", [up("boast"), boast, down()]), observers=(watch,))
    [refused] = named(told, "landing_refused")
    assert refused.fields["behavior"] == "boast"
    assert named(told, "behavior_failed")[0].fields["reason"].startswith("it reports a landing")
    assert path(told, "a")[:3] == ["up", "boast", "auto_land"]
    assert len(named(told, "landed")) == 1
    assert all(height < LOW for height in watch.stopped)


class Lifting(Behavior[NoParams], flight=AIR >> AIR, emits=CommandKind.ATTITUDE_THRUST):
    """Gives more thrust than the vehicle weighs."""

    def __init__(self, params: NoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self.thrust = 1.1 * entry.hover_thrust

    def update(self, tick: Tick) -> Command:
        return Command(LEVEL, self.thrust, ZERO, None)


@pytest.mark.thorough
def test_a_landing_goes_on_with_nothing_of_what_was_before(run, monkeypatch):
    """Neither the thrust of the state before, nor the time for which another landing waited."""
    monkeypatch.setattr("kybflow.runtime.vehicle.behavior_runner.MAX_REFUSAL_NS", 2 * NS)
    watch = Watch("a")
    lift = state("lift", Lifting, TransitionPlan(target="boast", cause="within", after=0.1))
    boast = state("boast", Boasting, then("landed"), failed("again"))
    again = state("again", Boasting, then("landed"), failed("auto_land"))
    _, told = run(vehicle("a", [up("lift"), lift, boast, again, down()]), observers=(watch,))
    assert [e.fields["behavior"] for e in named(told, "landing_refused")] == ["boast", "again"]
    boasted, claimed = (e.time for e in named(told, "behavior_failed"))
    assert claimed - boasted > 2 * NS
    assert watch.top < 1.5


def test_whom_its_own_watchdog_lands_it_has_not_landed_by_our_word(tmp_path):
    """The link is cut and back, and no estimate is left: what its IMU feels is not our thrust."""
    cut = fault("link_cut", 5.28, 1.24, on="nano", way="to_vehicle")
    lost = fault("mocap_dropout", 5.68, 2.75, on="nano")
    _, told, watch = touch_down("first_flight", 1016, tmp_path, cut, lost)
    assert named(told, "control_lost")[0].fields["reason"] == "its own watchdog lands it"
    assert len(named(told, "landed")) == 1
    assert watch.stopped
    assert all(height < LOW for height in watch.stopped)
