"""A clamped setpoint is told, and a behavior whose goal is clamped has not arrived."""

import json
from pathlib import Path

import pytest
from plans import part, plan, state, then, vehicle
from short_flights import NoParams
from toolchain import flight_of

from kybflow.core.signals import NS, Done, Event, Setpoint, SetpointKind, Tick
from kybflow.dsl.plan import PartPlan, TransitionPlan
from kybflow.flight.motion import Straight
from kybflow.parts import AIR, Behavior, Entry
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.control import Clamps

TOP = 2.3
"""The fence's highest height less its margin, metres."""


class Rise(Behavior[NoParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """A lab's behavior: up to 3.8 m, which is done when its time is up, wherever it is."""

    goal, hold = 3.8, 2.0

    def __init__(self, params: NoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        x, y, _ = entry.position
        self._way = Straight(entry.position, (x, y, self.goal), 1.0, 0.7)

    def update(self, tick: Tick) -> Setpoint | Done:
        setpoint = self._way.at(tick.elapsed).setpoint(0.0)
        return Done(setpoint) if tick.elapsed > self._way.duration + self.hold else setpoint


class RiseLow(Rise, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Up to 2 m, and there for long enough."""

    goal, hold = 2.0, 3.0


class RiseAndReturn(Rise, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Up and back under the fence."""

    goal = 2.5

    def __init__(self, params: NoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        x, y, _ = start = entry.position
        self._back = Straight((x, y, self.goal), start, 0.3, 0.7)

    def update(self, tick: Tick) -> Setpoint | Done:
        after = tick.elapsed - self._way.duration
        motion = self._way.at(tick.elapsed) if after < 0.0 else self._back.at(after)
        setpoint = motion.setpoint(0.0)
        return Done(setpoint) if after > self._back.duration + self.hold else setpoint


def lab_flight(behavior: type[Rise], out: Path, *more: PartPlan):
    lab = PartPlan("rise", behavior, NoParams(), "rise", "lab.yaml:9")
    failed = TransitionPlan(target="auto_land", cause="failed", implied=True)
    states = [
        state("up", part("behaviors", "take_off", height=1.0), then("rise")),
        state("rise", lab, then("down"), failed),
        state("down", part("behaviors", "land"), then("landed")),
    ]
    processors = (*(part("processors", name) for name in ("fence", "position_error")), *more)
    made = plan(vehicle("a", states, processors=processors))
    flight, told = flight_of(made, out)
    visit = flight.summary["vehicles"]["a"]["behaviors"][1]
    return flight, visit, [event for event in told if event.name.startswith("clamp")]


@pytest.mark.thorough
def test_a_behavior_whose_goal_is_clamped_has_failed(tmp_path: Path):
    flight, visit, _ = lab_flight(Rise, tmp_path)
    assert visit["ended"] == "failed"
    assert flight.summary["outcome"] == "failed"
    assert "`fence` keeps the setpoint 1.5 m from the requested one" in flight.summary["reason"]


@pytest.mark.thorough
def test_its_error_is_from_what_it_wanted(tmp_path: Path):
    _, visit, _ = lab_flight(Rise, tmp_path)
    assert visit["position_error_m"]["max"] == pytest.approx(3.8 - TOP, abs=0.02)


@pytest.mark.thorough
def test_a_clamp_is_told_once_when_it_begins_and_once_when_it_ends(tmp_path: Path):
    _, _, (began, ended) = lab_flight(Rise, tmp_path)
    assert (began.name, began.fields["processor"]) == ("clamp_started", "fence")
    assert (ended.name, ended.fields["processor"]) == ("clamp_ended", "fence")
    assert ended.fields["most"] == "1.5 m"
    assert began.at == ended.at
    assert ended.time / NS - began.time / NS == pytest.approx(ended.fields["seconds"], abs=0.6)


@pytest.mark.thorough
def test_one_that_has_come_back_inside_is_done(tmp_path: Path):
    flight, visit, (began, ended) = lab_flight(RiseAndReturn, tmp_path)
    assert (visit["ended"], flight.summary["outcome"]) == ("done", "succeeded")
    assert began.time < ended.time < visit["end_s"] * NS


@pytest.mark.thorough
def test_what_only_comes_later_is_no_clamp(tmp_path: Path):
    slow = part("processors", "limit_speed", speed=0.3)
    _, visit, clamps = lab_flight(RiseLow, tmp_path, slow)
    assert visit["position_error_m"]["max"] > 0.2
    assert (visit["ended"], clamps) == ("done", [])


def clamped(*setpoints: tuple[float, Setpoint, Setpoint]) -> list[Event]:
    """The events of setpoints as (seconds, asked, given), and of a second of silence."""
    told: list[Event] = []
    events = Events((told.append,))
    clamps = Clamps("a", {"a.processors.fence": "fence"}, {"a.processors.fence": "m:1"}, events)
    for seconds, asked, given in setpoints:
        events.now = round(seconds * NS)
        clamps.settle(events.now)
        clamps.note("a.processors.fence", asked, given, events.now)
    events.now += NS
    clamps.settle(events.now)
    return told


def at(height: float) -> Setpoint:
    return Setpoint(SetpointKind.POSITION, (0.0, 0.0, height))


def climbing(speed: float) -> Setpoint:
    return Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, speed))


def test_millimetres_are_no_clamp():
    assert clamped((0.0, at(2.31), at(2.3))) == []


def test_a_clamp_that_comes_back_at_once_is_the_same():
    names = [
        e.name for e in clamped(*((0.1 * n, at(3.0), at(2.3 + n % 2 * 0.7)) for n in range(9)))
    ]
    assert names == ["clamp_started", "clamp_ended"]


def test_a_clamp_that_comes_back_later_is_another():
    two = clamped((0.0, at(3.0), at(2.3)), (1.0, at(3.0), at(2.3)))
    assert [e.name for e in two] == ["clamp_started", "clamp_ended"] * 2


def test_velocities_are_clamped_too():
    began, ended = clamped((0.0, climbing(0.5), climbing(0.1)), (0.2, climbing(0.5), climbing(0.0)))
    assert "40 cm/s from" in began.fields["reason"]
    assert (ended.fields["most"], ended.fields["seconds"]) == ("50 cm/s", pytest.approx(0.2))


@pytest.mark.thorough
def test_the_record_has_both(tmp_path: Path):
    lab_flight(Rise, tmp_path)
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    names = [json.loads(line)["event"] for line in lines]
    assert names.count("clamp_started") == names.count("clamp_ended") == 1
