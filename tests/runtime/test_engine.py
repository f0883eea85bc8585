"""The engine, with plans built without YAML: order, failures, failsafe, nobody else disturbed."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path

import pytest
from plans import part, plan, state, then, vehicle

from kybflow.drivers.sim import Sim
from kybflow.dsl.plan import TransitionPlan
from kybflow.errors import Refused
from kybflow.parts import AIR, Behavior, Entry
from kybflow.runtime.flight import Flown, Request, fly
from kybflow.signals import Event, Failed, Setpoint, SetpointKind, Tick


@dataclass(frozen=True)
class NoParams:
    pass


class Still(Behavior[NoParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Holds its entry position; tests change what `update` does."""

    def __init__(self, params: NoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self.setpoint = Setpoint(
            SetpointKind.POSITION, entry.position, (0.0,) * 3, (0.0,) * 3, heading=entry.heading
        )

    def update(self, tick: Tick) -> Setpoint | Failed:
        return self.setpoint


class Exploding(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def update(self, tick: Tick) -> Setpoint:
        if tick.elapsed > 1.0:
            raise ZeroDivisionError("a lab's own bug")
        return self.setpoint


class NotFinite(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def update(self, tick: Tick) -> Setpoint:
        return self.setpoint._replace(position=(nan, 0.0, 1.0))


class Refusing(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: NoParams, entry: Entry) -> None:
        raise Refused("the door is shut")


class Failing(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def update(self, tick: Tick) -> Failed:
        return Failed(self.setpoint, "no way through")


class Jumping(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Asks for a place one metre away at once."""

    def update(self, tick: Tick) -> Setpoint:
        x, y, z = self.setpoint.position or (0.0, 0.0, 1.0)
        return self.setpoint._replace(position=(x + 1.0, y, z))


def up(target: str, height: float = 0.6):
    return state("up", part("behaviors", "take_off", height=height), then(target))


def down():
    return state("down", part("behaviors", "land"), then("landed"))


def hold(seconds: float, target: str):
    return state("hold", part("behaviors", "hover", for_time=seconds), then(target))


Run = Callable[..., tuple[Flown, list[Event]]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def run(*vehicles, seed=0, options=(), observers=(), **facts):
        told: list[Event] = []
        request = Request(
            seed=seed, out=tmp_path / str(len(list(tmp_path.iterdir()))), options=options
        )
        return fly(plan(*vehicles, **facts), request, (told.append,), observers), told

    return run


def path(told: list[Event], name: str) -> list[str]:
    """The states that a vehicle was in, in order."""
    return [
        str(e.fields["behavior"])
        for e in told
        if e.name == "behavior_started" and e.vehicle == name
    ]


def named(told: list[Event], event: str) -> list[Event]:
    return [e for e in told if e.name == event]


def test_a_flight_goes_through_its_states_and_ends_on_the_ground(run):
    flown, told = run(vehicle("a", [up("hold"), hold(1.0, "down"), down()]))
    assert flown.exit_code == 0
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert [e.name for e in told if e.name in ("took_off", "landed")] == ["took_off", "landed"]
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_the_same_plan_and_seed_give_the_same_bytes_and_another_seed_others(run):
    def a():
        return vehicle("a", [up("down"), down()])

    first, second, other = (run(a(), seed=s)[0].folder for s in (3, 3, 4))
    log = "log.mcap"
    assert (first / log).read_bytes() == (second / log).read_bytes()
    assert (first / "events.jsonl").read_bytes() == (second / "events.jsonl").read_bytes()
    assert (first / log).read_bytes() != (other / log).read_bytes()


def test_a_part_that_raises_lands_its_vehicle_and_no_other(run):
    good = [up("hold"), hold(2.0, "down"), down()]
    calm, _ = run(vehicle("a", good, start=(-1.0, 0.0, 0.0)), vehicle("b", [up("down"), down()]))
    bad = [up("boom"), state("boom", Exploding, then("down")), down()]
    flown, told = run(vehicle("a", good, start=(-1.0, 0.0, 0.0)), vehicle("b", bad))
    assert path(told, "b") == ["up", "boom", "auto_land", "fault"]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    [failed] = named(told, "part_failed")
    assert failed.fields == {
        "part": "behaviors.boom",
        "reason": "ZeroDivisionError: a lab's own bug",
    }
    assert flown.exit_code == 1
    assert "b ended in `fault`" in flown.summary["reason"]
    errors = [f.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"] for f in (calm, flown)]
    assert errors[0] == errors[1]


def test_a_setpoint_that_is_not_finite_is_a_failure_in_the_same_tick(run):
    states = [up("nan"), state("nan", NotFinite, then("down")), down()]
    flown, told = run(vehicle("a", states))
    began = next(e.time for e in told if e.fields.get("behavior") == "nan")
    [failed] = named(told, "part_failed")
    assert failed.time == began
    assert path(told, "a")[-1] == "fault"
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_a_behavior_that_refuses_to_start_goes_where_its_failed_says(run):
    shut = state("shut", Refusing, then("down"), TransitionPlan("failed", "down"))
    _, told = run(vehicle("a", [up("shut"), shut, down()]))
    assert path(told, "a") == ["up", "shut", "down", "landed"]
    [failed] = named(told, "behavior_failed")
    assert failed.fields == {"behavior": "shut", "reason": "the door is shut"}


def test_without_a_failed_arrow_a_refusal_brakes_hovers_and_lands(run):
    shut = state("shut", Refusing, then("down"))
    _, told = run(vehicle("a", [up("shut"), shut, down()], hover_limit=1.0))
    assert path(told, "a") == ["up", "shut", "brake", "hover", "auto_land", "landed"]


def test_a_behavior_that_fails_goes_where_its_failed_says(run):
    failing = state("try", Failing, then("hold"), TransitionPlan("failed", "down"))
    _, told = run(vehicle("a", [up("try"), failing, hold(9.0, "down"), down()]))
    assert path(told, "a") == ["up", "try", "down", "landed"]
    assert named(told, "behavior_failed")[0].fields["reason"] == "no way through"


def test_within_ends_a_state_that_takes_too_long(run):
    still = state("still", Still, then("hold"), TransitionPlan("within", "down", after=2.0))
    flown, told = run(vehicle("a", [up("still"), still, hold(9.0, "down"), down()]))
    assert path(told, "a") == ["up", "still", "down", "landed"]
    visit = flown.summary["vehicles"]["a"]["behaviors"][1]
    assert visit["ended"] == "within"
    assert visit["end_s"] - visit["start_s"] == pytest.approx(2.0, abs=1e-3)


def test_a_setpoint_that_jumps_away_brakes(run):
    jump = state("jump", Jumping, then("down"))
    flown, told = run(vehicle("a", [up("jump"), jump, down()], hover_limit=1.0))
    assert path(told, "a") == ["up", "jump", "brake", "hover", "auto_land", "landed"]
    assert named(told, "position_error_exceeded")[0].fields["value"] == pytest.approx(1.0, abs=0.1)
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_an_empty_battery_lands_and_latches(run):
    driver = part("drivers", "sim", battery=0.2)
    frame = vehicle("x", [down()]).airframe
    weak = type(frame)(**{**vars(frame), "endurance": 120.0})
    states = [up("hold"), hold(20.0, "down"), down()]
    flown, told = run(vehicle("a", states, driver=driver, airframe=weak))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert named(told, "failsafe_started")[0].fields["reaction"] == "land"
    assert flown.exit_code == 1


def test_a_lost_estimate_lands_blind_from_two_metres(run):
    class Deaf:
        """Motion capture goes silent at 8 s."""

        def __call__(self, engine):
            if engine.seconds() > 8.0:
                engine.vehicles[0]._link.read = lambda now: []

    states = [up("hold", height=1.5), hold(20.0, "down"), down()]
    flown, told = run(vehicle("a", states), observers=(Deaf(),))
    assert path(told, "a") == ["up", "hold", "land_blind", "fault"]
    [started] = named(told, "failsafe_started")
    assert started.fields["reaction"] == "land_blind"
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_an_interrupt_lands_and_leaves_a_whole_record(run):
    def interrupt(engine):
        if engine.seconds() > 5.0 and not engine.interrupts:
            signal.raise_signal(signal.SIGINT)

    states = [up("hold"), hold(60.0, "down"), down()]
    flown, told = run(vehicle("a", states), observers=(interrupt,))
    assert flown.exit_code == 130
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert json.loads((flown.folder / "summary.json").read_text())["outcome"] == "interrupted"


def test_the_time_limit_ends_a_run_that_hangs_in_the_air(run):
    flown, _ = run(vehicle("a", [up("still"), state("still", Still)]), time_limit=6.0)
    assert flown.exit_code == 1
    assert "time limit of 6 s" in flown.summary["reason"]
    assert flown.summary["vehicles"]["a"]["final"] == "air"


class DeafSim(Sim):
    """The simulator with motion capture switched off."""

    @classmethod
    def open(cls, seats, generator):
        session = super().open(seats, generator)
        for link in session.links.values():
            link.read = lambda now: []
        return session


def test_preflight_keeps_a_vehicle_without_poses_on_the_ground(run):
    silent = replace(part("drivers", "sim"), cls=DeafSim)
    flown, told = run(vehicle("a", [up("down"), down()], driver=silent))
    assert named(told, "behavior_started") == []
    assert flown.exit_code == 1
    assert "a: estimate: no healthy estimate from mocap" in flown.summary["reason"]


def test_options_of_the_command_line_reach_the_part_and_the_record(run):
    options = (("a.processors.position_error.limit", "20 cm"),)
    jump = state("jump", Jumping, then("down"))
    _, told = run(vehicle("a", [up("jump"), jump, down()], hover_limit=1.0), options=options)
    assert named(told, "option_changed")[0].fields["by"] == "command line"
    assert named(told, "position_error_exceeded")[0].fields["bound"] == pytest.approx(0.2)
