"""What a person gives while a mission flies."""

from __future__ import annotations

from threading import Thread

import pytest
from commanders import Asked, People
from plans import part, plan, state, vehicle
from short_flights import Still, down, hold, named, path, up

from kybflow.core.errors import EventRefused
from kybflow.core.signals import NS, Event, SetpointKind
from kybflow.dsl.plan import CallbackPlan, Emit, LogText, Stop, Switch, TransitionPlan
from kybflow.parts import AIR
from kybflow.runtime.commanding.command_queue import MOST_WAITING, CommandQueue
from kybflow.runtime.commanding.commander import Commander
from kybflow.runtime.commanding.legal import RunView, check_emitted
from kybflow.runtime.commanding.orders import SCHEDULE, Answer
from kybflow.runtime.commanding.situation import Situation
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.callbacks import RunControls


def idle(target: str):
    go = TransitionPlan(target=target, event="operator.go")
    return state("idle", part("behaviors", "wait_on_ground"), go)


def waiting():
    return vehicle("a", [idle("up"), up("hold"), hold(1.0, "down"), down()])


def held(seconds: float = 60.0, name: str = "a", **more):
    return vehicle(name, [up("hold"), hold(seconds, "down"), down()], **more)


def operators(told: list[Event]) -> list[str]:
    """The operator's events, in order."""
    return [name for e in told if (name := e.name.removeprefix("operator.")) != e.name]


@pytest.mark.thorough
def test_an_event_is_given_at_its_time_and_heard_in_the_next_tick(run):
    flown, told = run(waiting(), emitted=((2.0, "operator.go"),))
    [given] = named(told, "operator.go")
    assert (given.time, given.vehicle) == (2 * NS, "")
    left = next(e for e in named(told, "behavior_ended") if e.fields["behavior"] == "idle")
    assert left.time == 2 * NS + NS // 250
    assert path(told, "a") == ["idle", "up", "hold", "down", "landed"]
    assert flown.exit_code == 0


def test_events_are_given_in_the_order_of_their_times(run):
    _, told = run(waiting(), emitted=((3.0, "operator.land"), (0.5, "operator.go")))
    assert operators(told) == ["go", "land"]


@pytest.mark.thorough
def test_pause_holds_and_resume_goes_on_with_the_same(run):
    calm, _ = run(held(2.0))
    paused, told = run(held(2.0), emitted=((6.0, "operator.pause"), (9.0, "operator.resume")))
    assert [e.name for e in told if e.name in ("paused", "resumed")] == ["paused", "resumed"]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert paused.summary["sim_time_s"] > calm.summary["sim_time_s"] + 2.9
    assert paused.exit_code == 0


def test_land_lands(run):
    flown, told = run(held(), emitted=((8.0, "operator.land"),))
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]
    assert flown.exit_code == 0


@pytest.mark.thorough
def test_stop_lands_and_ends_a_vehicle_that_waits_on_the_ground_too(run):
    flying = held(name="b", start=(1.0, 1.0, 0.0))
    flown, told = run(waiting(), flying, emitted=((8.0, "operator.stop"),))
    assert named(told, "run_stopped")[0].fields == {"reason": "stopped by the operator"}
    assert path(told, "a") == ["idle", "landed"]
    assert path(told, "b")[-1] == "landed"
    assert flown.exit_code == 0


def test_what_nothing_waits_for_is_refused_with_the_nearest():
    with pytest.raises(EventRefused, match=r"`operator\.og`; did you mean `operator\.go`\?"):
        check_emitted(plan(waiting()), ["operator.og"])


@pytest.mark.parametrize("name", ["a.landed", "landed", "run_started"])
def test_nobody_can_give_an_event_of_the_engine(name: str):
    heard = CallbackPlan(event="landed", vehicles=("a",), actions=(LogText("down"),))
    with pytest.raises(EventRefused, match="the mission doesn't wait for"):
        check_emitted(plan(waiting(), callbacks=(heard,)), [name])


def test_a_mission_s_own_event_and_the_commands_can_be_given():
    own = (
        CallbackPlan(event="landed", vehicles=("a",), actions=(Emit("ready"),)),
        CallbackPlan(event="ready", vehicles=("",), actions=(LogText("ready"),)),
    )
    check_emitted(plan(held(), callbacks=own), ["ready", "operator.pause", "operator.stop"])


def answers(run, *asked: Asked, vehicles=None, **facts):
    """Each command with its answer, of a flight that is stopped after the last; and what was told.
    Every answer came within two ticks."""
    people = People(*asked, Asked(asked[-1].seconds + 0.1, "stop"))
    flown, told = run(
        *(vehicles or [held()]), servers=(people.serve,), observers=(people.look,), **facts
    )
    assert all(told.took <= 2 for told in people.told)
    assert all(isinstance(saw, Situation) for saw in people.saw)
    return [answer for answer in people.answers if answer[0] != "stop"], told, flown


def test_each_command_is_answered_once_and_refused_in_the_words_of_the_event(run):
    asked = [
        (4.0, "resume", False, "it is not paused"),
        (4.1, "pause", True, ""),
        (4.2, "pause a", True, ""),
        (4.3, "reset a", False, "it is in the air"),
        (4.4, "resume a", True, ""),
        (5.0, "switch a up", False, "`take_off` can't start while the vehicle is in the air"),
        (5.1, "switch a hver", False, "`a` has no state `hver`; did you mean `hover`?"),
        (5.2, "switch c up", False, "there is no vehicle `c`; known here: `a`"),
        (5.3, "switch a brake", True, ""),
        (5.4, "disable a.processors.fence", False, "a safety part can't be switched off"),
        (5.5, "disable a.processors.nothing", False, "only processors can be switched on and off"),
        (5.6, "emit operator.og", False, "the mission doesn't wait for `operator.og`; "
         "did you mean `operator.stop`?"),
        (5.7, "emit landed", False,
         "the mission doesn't wait for a person's `landed`: kybflow raises that event itself"),
        (5.8, "phase team go", False, "there is no flow `team`; "),
        (6.0, "land a", True, ""),
        (6.1, "switch a hover", False, "a person landed it, and it stays on the ground"),
    ]  # fmt: skip
    found, told, _ = answers(run, *(Asked(seconds, words) for seconds, words, *_ in asked))
    assert found == [(words, accepted, said) for _, words, accepted, said in asked]
    refused = [e.fields["reason"] for e in told if e.name.endswith("_refused")]
    assert set(refused) <= {said for *_, said in asked}
    given = [e.fields for e in named(told, "command_given")]
    assert [fields["command"] for fields in given] == [words for _, words, *_ in asked] + ["stop"]
    assert {fields["by"] for fields in given} == {"anna"}


def test_options_are_set_from_text_with_a_unit_and_only_tightened_in_flight(run):
    option = "a.processors.fence.margin"
    found, told, _ = answers(
        run,
        Asked(4.0, f"set {option} 30 cm"),
        Asked(4.5, f"set {option} 10 cm"),
        Asked(5.0, f"set {option} 3 kg"),
        Asked(5.5, "set a.processors.fence.mrgin 1 m"),
        Asked(5.5, f"set {option} 40 cm", "ben"),
    )
    assert [accepted for _, accepted, _ in found] == [True, False, False, False, False]
    assert "safety parameter: in flight it only becomes greater" in found[1][2]
    assert "did you mean" in found[3][2]
    assert "`anna` commands this run" in found[4][2]
    assert [e.fields["value"] for e in named(told, "option_changed")] == ["0.3"]


@pytest.mark.thorough
def test_vehicles_are_commanded_one_by_one_and_the_others_go_on(run):
    b = held(name="b", start=(1.0, 1.0, 0.0))
    found, told, flown = answers(
        run,
        Asked(4.0, "pause b"),
        Asked(5.0, "land b"),
        Asked(5.5, "pause a b"),
        Asked(5.6, "reset"),
        vehicles=[held(), b],
    )
    assert [e.vehicle for e in named(told, "paused")] == ["b", "a", "b"]
    assert path(told, "b")[-2:] == ["auto_land", "landed"]
    assert operators(told) == ["pause", "reset", "stop"]
    assert found[3] == ("reset", False, "a: it is in the air; b: it is in the air")
    assert flown.exit_code == 0, flown.summary["reason"]
    commanded = [one["command"] for one in flown.summary["commands"]]
    assert commanded == [*(words for words, accepted, _ in found if accepted), "stop"]


def test_an_event_that_comes_too_early_is_told_with_a_word_of_warning(run):
    states = [up("hold"), hold(0.5, "idle"), idle("down"), down()]
    states[2] = state("idle", part("behaviors", "hover"), *idle("down").transitions)
    found, told, _ = answers(
        run,
        Asked(1.0, "emit operator.go"),
        Asked(4.5, "emit operator.go"),
        vehicles=[vehicle("a", states)],
    )
    assert found == [
        ("emit operator.go", True, "nothing waits for it now"),
        ("emit operator.go", True, ""),
    ]
    assert path(told, "a")[:4] == ["up", "hold", "idle", "down"]


@pytest.mark.thorough
def test_one_commander_is_heard_until_another_takes_the_lease(run):
    found, told, _ = answers(
        run,
        Asked(4.0, "switch a brake"),
        Asked(4.1, "switch a hover", "ben"),
        Asked(4.2, "pause", "ben"),
        Asked(4.3, "resume", "ben", True),
        Asked(4.4, "switch a hover", "anna"),
        Asked(4.5, "leave", "anna"),
        Asked(4.6, "leave", "ben"),
        Asked(4.7, "switch a hover", "anna"),
    )
    assert [accepted for _, accepted, _ in found] == [True, False, True, True, False, True]
    assert found[1][2] == "`anna` commands this run; take the lease (`--take`) to command it"
    [taken] = named(told, "lease_taken")
    assert taken.fields == {"by": "ben", "previous": "anna"}
    released = [e for e in named(told, "command_given") if e.fields["command"] == "release"]
    assert [e.fields["by"] for e in released] == ["ben"]


@pytest.mark.thorough
def test_a_part_that_raises_is_an_answer_and_no_end_of_the_flight(run):
    class Broken(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
        def __init__(self, params, entry):
            raise RuntimeError("out of order")

    broken = vehicle("a", [up("hold"), hold(60.0, "down"), down(), state("bad", Broken)])
    found, told, _ = answers(run, Asked(5.0, "switch a bad"), vehicles=[broken])
    assert found == [("switch a bad", False, "RuntimeError: out of order")]
    assert path(told, "a")[-2:] == ["auto_land", "fault"]


def test_during_the_preflight_only_stop_is_heard_and_ends_the_run(run):
    people = People(Asked(0.0, "land"), Asked(0.2, "switch a up"), Asked(0.4, "stop"))
    outside = held(start=(5.0, 5.0, 0.0))
    flown, told = run(outside, servers=(people.serve,), observers=(people.look,))
    assert people.answers == [
        ("land", False, "the preflight is not over"),
        ("switch a up", False, "the preflight is not over"),
        ("stop", True, ""),
    ]
    assert flown.summary["reason"] == "stopped by the operator, before the preflight was over"
    assert people.saw[0].vehicles[0].enter["up"] == "the preflight is not over"
    assert not named(told, "behavior_started")


def test_what_waits_when_the_run_ends_is_answered_and_what_comes_later_too():
    queue, heard, saw = CommandQueue(), [], []
    queue.ask(Stop(""), "anna", heard.append)
    queue.look(saw.append)
    queue.close()
    queue.ask(Stop(""), "anna", heard.append)
    queue.look(saw.append)
    assert heard == [Answer(False, "the run is over")] * 2
    assert saw == [None, None]


def commander_of(queue: CommandQueue, requests=(), *listeners) -> Commander:
    """A commander that may stop a run and make these requests."""
    controls = RunControls(dict(requests), None, Events(listeners), None, lambda reason, at: None)
    return Commander(RunView(plan(held()), (), None), controls, None, queue)


def test_what_no_vehicle_has_answered_is_answered_at_the_end_and_once():
    class Slow:
        def read(self, state, written):
            return written

        def switch(self, state, by, at="", answered=None, values=()):
            self.answer = answered

    slow, queue, heard, told = Slow(), CommandQueue(), [], []
    commander = commander_of(queue, {"a": slow}, told.append)
    queue.ask(Switch("a", "hold"), "anna", heard.append)
    commander.step(0)
    assert heard == []
    queue.last_words += [lambda: "", lambda: "3 strangers"]
    commander.close()
    slow.answer(None)
    assert heard == [Answer(False, "the run is over")]
    assert [(e.name, e.fields) for e in told[:1]] == [
        ("clients_refused", {"reason": "3 strangers"})
    ]
    assert [e.fields["command"] for e in told[1:]] == ["switch a hold"]


def test_whoever_asks_from_many_threads_is_answered_once_each():
    queue, heard = CommandQueue(), []
    commander = commander_of(queue)

    def ask_all(name):
        for i in range(200):
            queue.ask(Stop(""), name, lambda answer, i=i: heard.append((name, i, answer)))

    threads = [Thread(target=ask_all, args=(name,)) for name in "abcd"]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        commander.step(0)
    commander.step(0)
    queue.close()
    assert sorted((name, i) for name, i, _ in heard) == [(n, i) for n in "abcd" for i in range(200)]
    assert {answer for *_, answer in heard} <= {Answer(True), Answer(False, "the run is over")}


def test_the_queue_is_bounded_and_takes_lines_only():
    queue, heard = CommandQueue(), []
    for _ in range(MOST_WAITING + 5):
        queue.ask(Stop(""), "anna", heard.append)
    assert heard == [Answer(False, f"{MOST_WAITING} commands are already waiting")] * 5
    for words, by in (("\ud800", "anna"), ("x" * 2000, "anna"), ("x", "a\nb"), ("x", SCHEDULE)):
        queue.ask(Emit(words), by, heard.append)
    assert [answer.accepted for answer in heard[5:]] == [False] * 4


def test_a_server_that_cannot_begin_is_told_and_the_flight_goes_on(run):
    def broken(queue, folder):
        raise OSError("no place left")

    flown, told = run(held(1.0), servers=(broken,))
    assert named(told, "commands_failed")[0].fields == {"reason": "OSError: no place left"}
    assert flown.exit_code == 0
