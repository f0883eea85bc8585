"""Callbacks: which events they answer, in which order, and that nothing they do stops the run."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from plans import state, then, vehicle
from short_flights import NoParams, Still, down, hold, named, path, up

from kybflow.core.errors import OptionRefused, PartFailed
from kybflow.core.events import BaseEvent, BehaviorEvent, Custom, Emitting
from kybflow.core.signals import NS, Event, Setpoint, SetpointKind, Tick
from kybflow.dsl.expressions import InState
from kybflow.dsl.plan import (
    Call,
    CallbackPlan,
    Emit,
    Enable,
    LogText,
    PartPlan,
    SetOption,
    Stop,
    Switch,
    TransitionPlan,
)
from kybflow.parts import AIR, Action, ActionContext, Entry
from kybflow.parts.events import BehaviorEnded, Collided, Landed, TookOff
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.callbacks import Callbacks, RunControls, filled
from kybflow.runtime.vehicle.requests import Requester


@dataclass(frozen=True)
class NoteParams:
    text: str = "noted"


class Note(Action[NoteParams]):
    """Says who was heard."""

    def __call__(self, event: Event, context: ActionContext) -> None:
        context.log(f"{self.params.text} {event.name} of {event.vehicle}")


class Broken(Action[NoParams]):
    def __call__(self, event: Event, context: ActionContext) -> None:
        raise ZeroDivisionError("a lab's own bug")


class Unmakeable(Broken):
    def __init__(self, params: NoParams) -> None:
        raise OSError("no loudspeaker")


class FakeVehicle:
    """Notes what it is asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple] = []

    def switch(self, state: str, by: Requester, at: str = "", values=()) -> None:
        self.asked.append(("switch", state, by, at))

    def enable(self, label: str, on: bool, by: str, at: str = "") -> None:
        self.asked.append(("enable", label, on, by, at))


class Bench:
    """Callbacks on a fake vehicle `a`, without a flight."""

    def __init__(self, *plans: CallbackPlan, refuses: bool = False, breaks: bool = False) -> None:
        self.told: list[Event] = []
        self.events = Events((self.told.append,))
        self.vehicle = FakeVehicle()
        self.asked = self.vehicle.asked
        self._refuses = refuses
        controls = RunControls({"a": self.vehicle}, self, self.events, self._phase, self._stop)
        condition = (lambda: 1 / 0) if breaks else (lambda: self.holds)
        self.callbacks = Callbacks(plans, controls, lambda _: condition)
        self.holds = True

    def hear(self, event: BaseEvent, vehicle: str = "a") -> None:
        self.events.emit(event, vehicle)
        self.callbacks.step()

    def set(self, name: str, value: object, by: str, at: str = "") -> None:
        self.asked.append(("set", name, value, by, at))
        if self._refuses:
            raise OptionRefused("too much")

    def _phase(self, *words: str) -> None:
        self.asked.append(("phase", *words))

    def _stop(self, *words: str) -> None:
        self.asked.append(("stop", *words))

    def logged(self) -> list[str]:
        return [str(e.fields["text"]) for e in self.told if e.name == "logged"]


def on(event: str, *actions, vehicles=("a",), **more) -> CallbackPlan:
    return CallbackPlan(event=event, vehicles=vehicles, actions=actions, at="m.yaml:9", **more)


def call(cls: type[Action], params: object = None) -> Call:
    name = cls.__name__.lower()
    return Call(PartPlan(name, cls, params or NoteParams(), f"actions.{name}", "m.yaml:9"))


def test_an_event_is_answered_once_by_whom_it_concerns():
    bench = Bench(on("landed", LogText("down")), on("landed", LogText("never"), vehicles=("b",)))
    bench.hear(Landed())
    bench.callbacks.step()
    assert bench.logged() == ["down"]


def test_what_a_simulator_alone_knows_is_not_answered():
    bench = Bench(on("collided", LogText("bang")))
    bench.hear(Collided(into="wall"))
    assert bench.logged() == []


def test_actions_are_done_in_order_and_say_where_they_come_from():
    actions = (
        Switch("a", "down"),
        SetOption("a.tracker.tilt", 0.1),
        Enable("a", "processors.smooth", False),
        Stop("enough"),
    )
    bench = Bench(on("landed", *actions))
    bench.hear(Landed())
    assert bench.asked == [
        ("switch", "down", Requester.CALLBACK, "m.yaml:9"),
        ("set", "a.tracker.tilt", 0.1, "callback", "m.yaml:9"),
        ("enable", "processors.smooth", False, "callback", "m.yaml:9"),
        ("stop", "enough", "m.yaml:9"),
    ]


def test_an_option_that_is_refused_is_told_by_the_options_alone():
    bench = Bench(on("landed", SetOption("a.tracker.tilt", 9.0), LogText("next")), refuses=True)
    bench.hear(Landed())
    assert bench.logged() == ["next"]
    assert named(bench.told, "action_failed") == []


@pytest.mark.parametrize(("how", "answered"), [("done", True), ("next", False)])
def test_a_filter_compares_a_field(how: str, answered: bool):
    bench = Bench(on("behavior_ended", LogText("over"), fields=(("how", "done"),)))
    bench.hear(BehaviorEnded(behavior="fly", how=how))
    assert bool(bench.logged()) is answered


def test_a_condition_must_hold_when_the_event_is_answered():
    bench = Bench(on("landed", LogText("down"), when=InState("a", "down")))
    bench.holds = False
    bench.hear(Landed())
    bench.holds = True
    bench.callbacks.step()
    assert bench.logged() == []
    bench.hear(Landed())
    assert bench.logged() == ["down"]


def test_what_is_emitted_is_answered_in_the_next_tick_one_round_a_tick():
    bench = Bench(on("ping", LogText("ping"), Emit("ping"), vehicles=("",)))
    bench.events.emit(Custom("ping"))
    for rounds in (1, 2, 3):
        bench.events.turn(rounds)
        assert bench.callbacks.pending
        bench.callbacks.step()
        assert bench.logged() == ["ping"] * rounds


def test_an_action_of_a_package_gets_the_event_and_its_parameters():
    bench = Bench(on("landed", call(Note, NoteParams("saw"))))
    bench.hear(Landed())
    assert bench.logged() == ["saw landed of a"]


def test_an_action_that_raises_is_told_and_left_out_and_the_others_go_on():
    bench = Bench(on("landed", call(Broken), LogText("still here")))
    for _ in range(2):
        bench.hear(Landed())
    assert bench.logged() == ["still here"] * 2
    [failed] = named(bench.told, "action_failed")
    assert failed.at == "m.yaml:9"
    traceback = str(failed.fields.pop("traceback"))
    assert failed.fields == {"action": "broken", "reason": "ZeroDivisionError: a lab's own bug"}
    assert "test_callbacks.py" in traceback


def test_an_action_that_cannot_be_made_is_known_before_anything_flies():
    with pytest.raises(PartFailed, match="no loudspeaker"):
        Bench(on("landed", call(Unmakeable)))


@pytest.mark.parametrize("name", ["landed", "operator.go"])
def test_an_action_may_not_speak_for_the_engine_or_a_person(name: str):
    bench = Bench(on("took_off", Emit(name)))
    bench.hear(TookOff())
    assert [e.name for e in bench.told] == ["took_off", "action_failed"]


def test_a_text_is_filled_with_what_the_event_carries():
    event = Event(2 * NS, "alarm", "a", {"value": 0.123456, "on": True, "who": None})
    text = "{event} {vehicle} {time} {value} {on} {who} {else} {{}}"
    assert filled(text, event) == "alarm a 2.00 s 0.1235 true none none {}"


@pytest.mark.thorough
def test_a_flight_is_switched_and_its_options_changed_by_its_events(run):
    speed = "b.processors.fence.margin"
    callbacks = (
        on("took_off", Switch("b", "down"), SetOption(speed, 0.4)),
        on("option_changed", LogText("{option} is {value}"), vehicles=("a", "b")),
    )
    a = vehicle("a", [up("hold"), hold(2.0, "down"), down()], start=(-1.0, 0.0, 0.0))
    b = vehicle("b", [up("hold", 0.3), hold(60.0, "down"), down()])
    flown, told = run(a, b, callbacks=callbacks)
    assert path(told, "b") in (["up", "hold", "down", "landed"], ["up", "down", "landed"])
    [ended] = [e for e in named(told, "behavior_ended") if e.fields["how"] == "asked"]
    assert (ended.vehicle, ended.at) == ("b", "m.yaml:9")
    assert [e.fields["text"] for e in named(told, "logged")] == [f"{speed} is 0.4"]
    assert [e.at for e in named(told, "option_changed")] == ["m.yaml:9"]
    assert flown.exit_code == 0


@pytest.mark.thorough
def test_what_was_told_before_the_first_tick_is_answered_in_it(run):
    callbacks = (
        on("run_started", LogText("begun"), vehicles=("",)),
        on("behavior_started", LogText("{behavior}"), fields=(("behavior", "up"),)),
    )
    _, told = run(vehicle("a", [up("down"), down()]), callbacks=callbacks)
    assert [e.fields["text"] for e in named(told, "logged")] == ["begun", "up"]


@pytest.mark.thorough
def test_a_vehicle_that_rests_is_waited_for_when_it_is_asked_for_more(run):
    again = on("behavior_started", Switch("a", "again"), fields=(("behavior", "landed"),))
    states = [up("down"), down(), state("again", up("x").behavior, then("hover"))]
    _, told = run(vehicle("a", states, hover_limit=60.0), callbacks=(again,), time_limit=16.0)
    assert path(told, "a")[:5] == ["up", "down", "landed", "again", "hover"]


def test_arrows_hear_what_is_emitted_one_tick_later(run):
    waits = state("hold", hold(60.0, "down").behavior, TransitionPlan(target="down", event="now"))
    callbacks = (on("behavior_started", Emit("now"), fields=(("behavior", "hold"),)),)
    _, told = run(vehicle("a", [up("hold"), waits, down()]), callbacks=callbacks)
    emitted = named(told, "now")[0].time
    left = next(e for e in named(told, "behavior_ended") if e.fields["behavior"] == "hold")
    assert left.time - emitted == NS // 250


@pytest.mark.thorough
def test_stop_lands_everybody_and_the_run_ended_as_it_should(run):
    callbacks = (on("took_off", Stop("seen enough")),)
    a = vehicle("a", [up("hold"), hold(60.0, "down"), down()], start=(-1.0, 0.0, 0.0))
    b = vehicle("b", [up("hold"), hold(60.0, "down"), down()])
    flown, told = run(a, b, callbacks=callbacks)
    [stopped] = named(told, "run_stopped")
    assert (stopped.fields["reason"], stopped.at) == ("seen enough", "m.yaml:9")
    assert flown.summary["sim_time_s"] < 30.0
    assert {v["final"] for v in flown.summary["vehicles"].values()} == {"ground"}
    assert flown.exit_code == 0


class Hummed(BehaviorEvent):
    """A second went by."""

    second: float


class Humming(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Emits each second, by the second."""

    own_events = (Hummed,)

    def __init__(self, params: NoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._told = 0

    def update(self, tick: Tick) -> Setpoint | Emitting:
        if tick.elapsed < self._told + 1:
            return self.setpoint
        self._told += 1
        return Emitting(self.setpoint, Hummed(second=float(self._told)))


class Mumbling(Humming, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    own_events = ()


@pytest.mark.thorough
def test_what_a_behavior_emits_is_answered_by_next_and_by_callbacks(run):
    callbacks = (on("hummed", LogText("{behavior} {second}")),)
    heard = TransitionPlan(target="down", event="hummed")
    _, told = run(
        vehicle("a", [up("hum"), state("hum", Humming, heard), down()]), callbacks=callbacks
    )
    assert [e.fields["text"] for e in named(told, "logged")] == ["hum 1"]
    assert path(told, "a") == ["up", "hum", "down", "landed"]


def test_a_behavior_that_emits_what_it_does_not_declare_has_failed(run):
    states = [up("hum"), state("hum", Mumbling, then("down")), down()]
    _, told = run(vehicle("a", states))
    [failed] = named(told, "part_failed")
    assert "`hummed` is none of its `own_events`" in str(failed.fields["reason"])


def when(*actions, state: str = "down", hold: float = 0.0) -> CallbackPlan:
    """A callback on a condition, which on the bench is that of the bench."""
    return on("", *actions, vehicles=(), when=InState("a", state), hold=hold)


def watched(bench: Bench, *holds: bool) -> int:
    """How often something was logged after ticks of a tenth of a second, each with the condition
    as `holds` says."""
    for bench.holds in holds:
        bench.events.turn(bench.events.now + NS // 10)
        bench.callbacks.watch()
    return len(bench.logged())


def test_a_condition_is_answered_each_time_that_it_begins_to_hold():
    bench = Bench(when(LogText("now")))
    assert watched(bench, False, True, True, True) == 1
    assert watched(bench, False, True) == 2
    assert watched(Bench(when(LogText("at once"))), True, True) == 1


def test_a_condition_with_for_is_answered_when_it_has_held_that_long():
    bench = Bench(when(LogText("at {time}"), hold=0.2))
    assert watched(bench, True, True) == 0
    assert watched(bench, False, True, True) == 0
    assert watched(bench, True, True) == 1
    assert bench.logged() == ["at 0.60 s"]


def test_a_condition_that_raises_is_told_once_and_not_answered():
    bench = Bench(when(LogText("never")), breaks=True)
    assert watched(bench, True, True) == 0
    assert len(named(bench.told, "action_failed")) == 1


def test_a_condition_switches_a_vehicle_in_flight_without_an_event(run):
    high = when(Switch("a", "down"), state="hold", hold=1.0)
    _, told = run(vehicle("a", [up("hold"), hold(60.0, "down"), down()]), callbacks=(high,))
    [asked] = [e for e in named(told, "behavior_ended") if e.fields["how"] == "asked"]
    [began] = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "hold"]
    assert asked.time - began.time == pytest.approx(NS, abs=3 * NS // 250)
