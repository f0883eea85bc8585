"""Flows: phases, barriers and their time-outs, give and return, what is refused and who is heard.

First on vehicles that do at once what they are asked, then in the simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from plans import part, plan, state, then, vehicle
from short_flights import Still, down, named, path, up

from kybflow.core.errors import OptionRefused
from kybflow.core.events import Custom
from kybflow.core.signals import NS, Event
from kybflow.dsl.expressions import GroupInState, InState
from kybflow.dsl.plan import (
    END,
    CallbackPlan,
    EnterPhase,
    FlowPlan,
    PartPlan,
    PhasePlan,
    Request,
    SetOption,
    Switch,
    TransitionPlan,
)
from kybflow.flight.motion import Pace
from kybflow.parts import Coordinator, Shares, Team, TeamMember, TeamTick
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.flows import Flows
from kybflow.runtime.vehicle.requests import Requester

DT = 0.1


@dataclass
class Obedient:
    """A vehicle that is in every state that it is asked to enter."""

    name: str
    state: str = "landed"
    paused: bool = False
    asked: list[str] = field(default_factory=list)
    comes_down: bool = False
    pace: Pace | None = None
    kept: Pace | None = None
    context: Any = None
    share: float | None = None

    def as_member(self) -> TeamMember:
        return TeamMember(None, "bar.left" if self.state == "push" else None)

    def take_share(self, share: float | None) -> None:
        self.share = share

    def keep(self, pace: Pace) -> None:
        self.kept = pace

    @property
    def requests(self) -> Obedient:
        return self

    def switch(self, state: str, by: Requester, at: str = "", values=()) -> None:
        assert by is Requester.FLOW
        self.asked.append(state)
        self.state = state


class Equal(Coordinator[float]):
    """Gives everybody who pushes the same. params: what all are given together."""

    def update(self, tick: TeamTick) -> Shares:
        pushing = [name for name, member in tick.members.items() if member.pushes]
        state = "push" if pushing else "wait"
        return (
            Shares(dict.fromkeys(pushing, self.params / len(pushing)), state)
            if pushing
            else (Shares({}, state, "nobody pushes"))
        )


class Broken(Equal):
    def __init__(self, params: float, team: Team) -> None:
        raise RuntimeError("no such load")


EQUAL = PartPlan("equal", Equal, 1.0, "coordinators.equal")


class Settings:
    def __init__(self) -> None:
        self.changed: list[tuple[str, Any, str]] = []

    def set(self, name: str, value: Any, by: str, at: str = "") -> None:
        if name.endswith("margin"):
            raise OptionRefused("it only tightens")
        self.changed.append((name, value, by))


def go(target: str, **when: Any) -> TransitionPlan:
    return TransitionPlan(target=target, **when)


def limit(target: str, seconds: float) -> TransitionPlan:
    return TransitionPlan(target=target, cause="within", after=seconds)


def phase(
    name: str,
    *arrows: TransitionPlan,
    run: dict[str, str] | None = None,
    give: dict[str, str] | None = None,
    options: tuple[SetOption, ...] = (),
) -> PhasePlan:
    return PhasePlan(
        name=name,
        run={v: Request(state) for v, state in (run or {}).items()},
        give=give or {},
        options=options,
        transitions=arrows,
    )


def flow(name: str, *phases: PhasePlan, vehicles: str = "", waits: bool = False) -> FlowPlan:
    """vehicles: those that the phases run, unless they are given or the flow waits for some."""
    members = {p.name: p for p in phases}
    run = () if waits else sorted({vehicle for p in phases for vehicle in p.run})
    own = tuple(vehicles or run)
    return FlowPlan(name=name, begin=phases[0].name, vehicles=own, phases=members, waits=waits)


class Stage:
    """Flows over obedient vehicles, tick by tick."""

    def __init__(self, *flows: FlowPlan) -> None:
        self.told: list[Event] = []
        self.events = Events([self.told.append])
        self.options = Settings()
        self.a, self.b, self.c = self.vehicles = [Obedient(name) for name in "abc"]
        states = {v.name: v for v in self.vehicles}

        def condition(expression: Any) -> Any:
            match expression:
                case InState(name, wanted):
                    return lambda: states[name].state == wanted
                case GroupInState("all", _, names, wanted):
                    return lambda: all(states[name].state == wanted for name in names)
            raise TypeError(expression)

        self.flows = Flows(plan(flows=flows), self.vehicles, condition, self.events, self.options)
        self.now = 0

    def step(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.now += round(DT * NS)
            self.events.turn(self.now)
            self.flows.step(self.now, DT)

    def phases(self, name: str) -> list[str]:
        visits = self.flows.record()[name]["phases"]
        return [f"{v['name']}: {v['ended']}" if v["ended"] else v["name"] for v in visits]

    def names(self) -> list[str]:
        return [event.name for event in self.told]


def staged(*phases: PhasePlan, **more: Any) -> Stage:
    """A stage with one flow, `team`."""
    return Stage(flow("team", *phases, **more))


BOTH_UP = GroupInState("all", "both", ("a", "b"), "up")


def test_a_phase_asks_its_vehicles_and_goes_on_when_all_are_there() -> None:
    stage = staged(
        phase("launch", go("land", when=BOTH_UP), run={"a": "up", "b": "up"}),
        phase("land", run={"a": "down", "b": "down"}),
    )
    stage.step()
    assert (stage.a.asked, stage.b.asked) == (["up"], ["up"])
    stage.b.state = "landed"
    stage.step(3)
    assert stage.phases("team") == ["launch"]
    stage.b.state = "up"
    stage.step()
    assert stage.phases("team") == ["launch: next", "land"]
    assert not stage.flows.ended


def test_a_barrier_that_takes_too_long_goes_otherwise() -> None:
    stage = staged(
        phase("launch", go("fly", when=BOTH_UP), limit("land", 1.0), run={"a": "up"}),
        phase("fly"),
        phase("land", run={"a": "down"}),
    )
    stage.step(11)
    assert stage.phases("team") == ["launch: within", "land"]
    assert stage.told[-2].fields == {"flow": "team", "phase": "launch", "how": "within"}


def test_the_last_phase_ends_its_flow_when_its_vehicles_have_left_what_it_asked_for() -> None:
    stage = staged(phase("land", run={"a": "down"}))
    stage.step(3)
    assert not stage.flows.ended
    stage.a.state = "landed"
    stage.step()
    assert stage.flows.ended
    assert stage.names()[-3:] == ["phase_ended", "flow_ended", "team.finished"]


def test_a_vehicle_in_a_chain_that_was_asked_for_is_still_in_it() -> None:
    stage = staged(phase("fetch", run={"a": "fetch"}))
    stage.step()
    stage.a.state = "fetch.lift"
    stage.step(2)
    assert not stage.flows.ended


def two() -> tuple[FlowPlan, FlowPlan]:
    """`team` gives b to `solo`, which takes 0.5 s."""
    return (
        flow(
            "team",
            phase("part", go("join", event="solo.finished"), give={"b": "solo"}, run={"a": "turn"}),
            phase("join", go("end", after=1.0), run={"a": "up", "b": "up"}),
        ),
        flow("solo", phase("alone", go("end", after=0.5), run={"b": "away"}), waits=True),
    )


@pytest.mark.parametrize("order", [1, -1])
def test_a_flow_drives_what_it_was_given_and_gives_it_back_when_it_ends(order: int) -> None:
    stage = Stage(*two()[::order])
    assert stage.flows.driver("b") == "team"
    stage.step(2)
    assert stage.flows.driver("b") == "solo"
    assert (stage.a.asked, stage.b.asked) == (["turn"], ["away"])
    stage.step(6)
    assert stage.flows.driver("b") == "team"
    assert stage.b.asked == ["away", "up"]
    assert [e.fields["flow"] for e in named(stage.told, "driver_changed")] == ["solo", "team"]


def test_a_flow_that_waits_begins_with_each_vehicle_that_it_is_given() -> None:
    team, solo = two()
    again = flow(
        "team",
        team.phases["part"],
        phase("join", go("part", after=1.0), run={"a": "up", "b": "up"}),
        vehicles="ab",
    )
    stage = Stage(again, solo)
    stage.step(20)
    assert stage.phases("solo")[:2] == ["alone: next", "alone"]


def test_a_flow_that_another_begins_in_the_first_tick_begins_once() -> None:
    """`solo` has a vehicle of its own, so that it does not wait for the one that it is given."""
    team = flow("team", phase("part", go("end", after=1.0), give={"b": "solo"}), vehicles="b")
    solo = flow("solo", phase("alone", go("end", after=0.5), run={"b": "away"}), vehicles="a")
    stage = Stage(team, solo)
    stage.step()
    assert stage.phases("solo") == ["alone"]
    assert stage.names().count("phase_started") == 2


def test_what_a_flow_asks_of_a_vehicle_that_another_drives_is_refused() -> None:
    _, solo = two()
    greedy = flow(
        "team",
        phase("part", go("grab", after=0.2), give={"b": "solo"}),
        phase("grab", go("end", after=9.0), give={"b": "solo"}, run={"a": "up", "b": "up"}),
    )
    stage = Stage(greedy, solo)
    stage.step(5)
    assert stage.b.asked == ["away"]
    assert stage.a.asked == ["up"]
    [refused] = named(stage.told, "switch_refused")
    assert (refused.vehicle, refused.fields["reason"]) == ("b", "`solo` drives it")
    [kept] = named(stage.told, "give_refused")
    assert kept.fields == {"flow": "team", "to": "solo", "reason": "`solo` drives it"}


def test_the_time_of_a_flow_stands_still_while_one_of_its_vehicles_is_paused() -> None:
    stage = staged(phase("wait", limit("land", 1.0), run={"a": "up"}), phase("land"))
    stage.step(5)
    stage.a.paused = True
    stage.step(50)
    stage.a.paused = False
    stage.step(5)
    assert stage.phases("team") == ["wait"]
    stage.step(2)
    assert stage.phases("team")[0] == "wait: within"


def test_a_turn_passes_when_who_fails_in_it_is_down() -> None:
    over = replace(phase("over", run={"a": "x", "b": "x"}), arrive="in_turns")
    stage = staged(over, vehicles="ab")
    stage.step(3)
    stage.a.state, stage.a.comes_down = "auto_land", True
    stage.step(5)
    assert stage.b.asked == []
    stage.a.comes_down = False
    stage.step()
    assert stage.b.asked == ["x"]


def test_those_who_begin_while_another_is_paused_arrive_together_too() -> None:
    over = replace(phase("over", run={"a": "x", "b": "x"}), arrive="together")
    stage = staged(over, vehicles="abc")
    stage.a.pace, stage.b.pace, stage.c.paused = Pace(4.0, 1.0), Pace(2.0, 2.0), True
    stage.step(3)
    assert stage.a.kept == stage.b.kept == Pace(4.0, 2.0)
    assert stage.c.kept is None


def test_a_person_who_lands_ends_every_flow() -> None:
    team, solo = two()
    stage = Stage(team, solo)
    stage.step(2)
    stage.flows.give_up()
    stage.step()
    assert stage.flows.ended
    assert (stage.phases("team"), stage.phases("solo")) == (["part: operator"], ["alone: operator"])
    stage.step(20)
    assert (stage.a.asked, stage.b.asked) == (["turn"], ["away"])


def test_options_are_set_before_states_are_asked_for_and_a_refusal_stops_nothing() -> None:
    options = (SetOption("a.processors.fence.margin", 0.1), SetOption("a.tracker.gain", 2.0))
    stage = staged(phase("go", run={"a": "up"}, options=options))
    stage.step()
    assert stage.options.changed == [("a.tracker.gain", 2.0, "flow team")]
    assert stage.a.asked == ["up"]


def test_a_phase_can_be_entered_from_outside_and_an_ended_flow_goes_on() -> None:
    stage = staged(phase("fly"), phase("land", run={"a": "down"}))
    stage.step(2)
    assert stage.flows.ended
    stage.flows.enter("team", "land", "callback")
    assert stage.a.asked == ["down"]
    assert stage.phases("team") == ["fly: done", "land"]


def test_a_flow_that_waits_can_not_be_entered_without_a_vehicle() -> None:
    stage = Stage(*two())
    stage.flows.enter("solo", "alone", "callback")
    assert stage.names() == ["phase_refused"]
    assert stage.told[0].fields["reason"] == "no flow has given `solo` a vehicle"


def test_a_coordinator_gives_each_vehicle_its_share_until_the_phase_ends() -> None:
    both = {"a": "push", "b": "push"}
    law = replace(phase("push", go("land", after=1.0), run=both), coordinator=EQUAL)
    stage = staged(law, phase("land", go("end", after=5.0)))
    stage.step(3)
    assert (stage.a.share, stage.b.share, stage.c.share) == (0.5, 0.5, None)
    stage.b.state = "away"
    stage.step()
    assert (stage.a.share, stage.b.share) == (1.0, None)
    stage.a.state = "away"
    stage.step()
    changed = [event.fields for event in named(stage.told, "coordinator_changed")]
    assert changed == [
        {"flow": "team", "state": "push", "reason": ""},
        {"flow": "team", "state": "wait", "reason": "nobody pushes"},
    ]
    stage.a.state = "push"
    stage.step(10)
    assert stage.phases("team") == ["push: next", "land"]
    assert stage.a.share is None


@pytest.mark.parametrize("total", [float("nan"), "much"])
def test_a_coordinator_that_fails_ends_its_flow_and_nobody_keeps_a_share(total: Any) -> None:
    law = replace(phase("push", run={"a": "push"}), coordinator=replace(EQUAL, params=1.0))
    stage = staged(law)
    stage.step(2)
    assert stage.a.share == 1.0
    stage.flows.running("team").coordinator.params = total
    stage.step()
    assert [event.name for event in stage.told][-4:-3] == ["flow_failed"]
    assert stage.a.share is None


def test_a_coordinator_that_can_not_be_made_ends_its_flow_only() -> None:
    part = PartPlan("broken", Broken, 1.0, "coordinators.broken")
    team = flow("team", replace(phase("push", run={"a": "push"}), coordinator=part))
    stage = Stage(team, flow("solo", phase("alone", go("end", after=9.0), run={"b": "up"})))
    stage.step(3)
    [failed] = named(stage.told, "flow_failed")
    assert failed.fields["flow"] == "team"
    assert (stage.a.share, stage.phases("solo")) == (None, ["alone"])


# In the simulator.


def waiting(name: str, **more: Any):
    """A vehicle that stands in `landed` until its flow asks for `up`."""
    states = [up("hover"), state("still", Still, then("down")), down()]
    return vehicle(name, states, **{"begin": "landed", **more})


UP, LANDED = InState("a", "hover"), InState("a", "landed")


def test_a_vehicle_that_waits_for_its_flow_does_not_end_the_run(run) -> None:
    team = flow(
        "team",
        phase("wait", go("launch", after=2.0)),
        phase("launch", go("land", when=UP), limit("land", 20.0), run={"a": "up"}),
        phase("land", run={"a": "down"}),
    )
    flown, told = run(waiting("a"), flows=(team,))
    assert flown.exit_code == 0
    assert path(told, "a") == ["landed", "up", "hover", "down", "landed"]
    phases = flown.summary["flows"]["team"]["phases"]
    assert [(p["name"], p["ended"]) for p in phases] == [
        ("wait", "next"), ("launch", "next"), ("land", "done"),
    ]  # fmt: skip
    assert phases[1]["start_s"] - phases[0]["start_s"] == pytest.approx(2.0, abs=0.01)


@pytest.mark.thorough
def test_a_switch_that_the_flight_types_forbid_is_heard_by_the_flow(run) -> None:
    team = flow(
        "team",
        phase(
            "wrong", go("right", event="a.switch_refused"), limit("end", 5.0), run={"a": "still"}
        ),
        phase("right", go("land", when=UP), limit("land", 20.0), run={"a": "up"}),
        phase("land", run={"a": "down"}),
    )
    flown, told = run(waiting("a"), flows=(team,))
    assert path(told, "a") == ["landed", "up", "hover", "down", "landed"]
    [refused] = named(told, "switch_refused")
    assert (refused.fields["state"], refused.fields["by"]) == ("still", "flow")
    assert flown.exit_code == 0


def aloft(*more: PhasePlan, **rest: Any) -> FlowPlan:
    """A flow that takes off and goes on with `more`."""
    launch = phase("launch", go(more[0].name, when=UP), limit("end", 20.0), run={"a": "up"})
    return flow("team", launch, *more, vehicles="a", **rest)


def when_begins(name: str, act: Callable[[Any], None]) -> dict[str, tuple[Any]]:
    """What `run` takes to have `act` done with the vehicle when the phase `name` begins."""
    engines: list[Any] = []

    def listener(event: Event) -> None:
        if event.name == "phase_started" and event.fields["phase"] == name:
            act(engines[0].vehicles[0])

    return {"observers": (engines.append,), "listeners": (listener,)}


AT_STILL = {"event": "phase_started", "fields": (("phase", "still"),), "vehicles": ("",)}


@pytest.mark.thorough
def test_the_flow_decides_before_a_callback_and_before_the_vehicle_itself(run) -> None:
    """In the tick in which `still` begins, a callback asks to land, and `hover` would land too."""
    team = aloft(
        phase("still", go("land", after=1.0), run={"a": "still"}), phase("land", run={"a": "down"})
    )
    callback = CallbackPlan(actions=(Switch("a", "auto_land"),), **AT_STILL)
    _, told = run(waiting("a"), flows=(team,), callbacks=(callback,))
    assert path(told, "a")[:4] == ["landed", "up", "hover", "still"]
    [refused] = named(told, "switch_refused")
    assert refused.fields["by"] == "callback"


def test_an_operator_decides_before_the_flow(run) -> None:
    team = aloft(phase("still", go("end", after=1.0), run={"a": "still"}))
    operator = when_begins("still", lambda a: a.requests.switch("down", Requester.OPERATOR))
    flown, told = run(waiting("a"), flows=(team,), **operator)
    assert path(told, "a") == ["landed", "up", "hover", "down", "landed"]
    [refused] = named(told, "switch_refused")
    assert (refused.fields["state"], refused.fields["by"]) == ("still", "flow")
    assert flown.exit_code == 0


def test_a_supervisor_decides_before_all_and_its_latch_refuses_the_flow(run) -> None:
    team = aloft(
        phase(
            "still", go("again", event="a.switch_refused"), limit("land", 9.0), run={"a": "still"}
        ),
        phase("again", go("land", after=0.5), run={"a": "still"}),
        phase("land", run={"a": "down"}),
    )
    supervisor = when_begins("still", lambda a: a.land("a person says so"))
    flown, told = run(waiting("a"), flows=(team,), **supervisor)
    assert path(told, "a") == ["landed", "up", "hover", "auto_land", "fault"]
    assert {e.fields["by"] for e in named(told, "switch_refused")} == {"flow"}
    assert [p["name"] for p in flown.summary["flows"]["team"]["phases"]][:3] == [
        "launch", "still", "again",
    ]  # fmt: skip


def test_a_callback_enters_a_phase(run) -> None:
    team = aloft(
        phase("still", go("land", after=30.0), run={"a": "still"}), phase("land", run={"a": "down"})
    )
    callback = CallbackPlan(actions=(EnterPhase("team", "land"),), **AT_STILL)
    flown, _ = run(waiting("a"), flows=(team,), callbacks=(callback,), time_limit=12.0)
    ends = [(p["name"], p["ended"]) for p in flown.summary["flows"]["team"]["phases"]]
    assert ends == [("launch", "next"), ("still", "asked"), ("land", "done")]


@pytest.mark.thorough
def test_a_run_whose_vehicles_are_all_lost_ends_though_a_flow_waits(run) -> None:
    team = aloft(phase("forever", go("end", event="operator.go"), run={"a": "still"}))
    fault = when_begins("forever", lambda a: a.land("lost"))
    flown, _ = run(waiting("a"), flows=(team,), **fault)
    assert flown.summary["sim_time_s"] < 30.0
    assert flown.summary["flows"]["team"]["phases"][-1]["ended"] == "run_ended"


@pytest.mark.thorough
def test_a_pad_that_is_left_and_come_back_to_is_one_flow_of_two_vehicles(run) -> None:
    """b waits in the air while a, given to `solo`, lands, waits and takes off again."""
    both = GroupInState("all", "both", ("a", "b"), "hover")
    team = flow(
        "team",
        phase("launch", go("part", when=both), limit("land", 20.0), run={"a": "up", "b": "up"}),
        phase("part", go("land", event="solo.finished"), give={"a": "solo"}),
        phase("land", run={"a": "down", "b": "down"}),
    )
    solo = flow(
        "solo",
        phase("sit", go("again", when=LANDED, hold=1.0), limit("end", 20.0), run={"a": "down"}),
        phase("again", go("end", when=UP), limit("end", 20.0), run={"a": "up"}),
        waits=True,
    )
    flown, told = run(
        waiting("a", start=(-1.0, 0.0, 0.0)), waiting("b", start=(1.0, 0.0, 0.0)),
        flows=(team, solo),
    )  # fmt: skip
    assert flown.exit_code == 0
    round_trip = ["up", "hover", "down", "landed"]
    assert path(told, "a") == ["landed", *round_trip, *round_trip]
    assert path(told, "b") == ["landed", *round_trip]


def last(*ways: TransitionPlan) -> PhasePlan:
    """A phase that ends by itself, with ways out that its flow has in every phase."""
    return replace(phase("last", *ways, run={"a": "down"}), ends=True)


def test_a_last_phase_with_a_way_out_of_every_phase_ends_by_itself():
    stage = staged(last(go("other", event="alarm")), phase("other"), vehicles="a")
    stage.step(3)
    assert not stage.flows.ended
    stage.a.state = "landed"
    stage.step(2)
    assert stage.flows.ended
    assert stage.flows.record()["team"]["phases"][-1]["ended"] == "done"


def test_a_last_phase_is_left_by_a_way_out_of_every_phase():
    other = phase("other", go(END, after=60.0), run={"a": "up"})
    stage = staged(last(go("other", event="alarm")), other, vehicles="a")
    stage.step(2)
    stage.events.emit(Custom("alarm"))
    stage.step(2)
    assert stage.a.asked == ["down", "up"]
    assert not stage.flows.ended


def test_a_way_out_of_a_phase_tells_its_event():
    stage = staged(phase("first", go(END, after=0.2, emit="ready", at="m.yaml:7")), vehicles="a")
    stage.step(5)
    [told] = named(stage.told, "ready")
    assert (told.vehicle, told.at) == ("", "m.yaml:7")


@pytest.mark.thorough
def test_a_way_out_of_a_state_tells_its_event_to_everybody(run):
    tells = state("hold", hover(), TransitionPlan(target="down", after=1.0, emit="a_is_done"))
    hears = state("hold", hover(), TransitionPlan(target="down", event="a_is_done"))
    a = vehicle("a", [up("hold"), tells, down()], start=(-1.0, 0.0, 0.0))
    b = vehicle("b", [up("hold", 0.3), hears, down()])
    _, told = run(a, b)
    [event] = named(told, "a_is_done")
    left = [e for e in named(told, "behavior_ended") if e.fields["behavior"] == "hold"]
    assert [e.vehicle for e in left] == ["a", "b"]
    assert left[0].time == event.time
    assert left[1].time - event.time == NS // 250


def hover() -> PartPlan:
    return part("behaviors", "hover", for_time=60.0)


def in_turns(*ways: TransitionPlan) -> Stage:
    """A phase in which `a` and `b`, which hover, fly `over` in turns."""
    over = replace(phase("over", *ways, run={"a": "over", "b": "over"}), arrive="in_turns")
    stage = staged(over, phase("next"), vehicles="ab")
    stage.a.state = stage.b.state = "hover"
    stage.step()
    return stage


BOTH_HOVER = GroupInState("all", "both", ("a", "b"), "hover")


def test_in_turns_the_next_is_asked_when_the_one_before_has_left_its_state() -> None:
    stage = in_turns(go("next", when=BOTH_HOVER))
    stage.step(3)
    assert (stage.a.asked, stage.b.asked) == (["over"], [])
    stage.a.state = "hover"
    stage.step()
    assert stage.b.asked == ["over"]
    stage.step(3)
    assert stage.phases("team") == ["over"]
    stage.b.state = "hover"
    stage.step()
    assert stage.phases("team") == ["over: next", "next"]


def test_while_a_turn_passes_no_way_out_is_asked_and_no_event_is_lost() -> None:
    stage = in_turns(go("next", when=BOTH_HOVER, event="go_on"), go("next", event="gone"))
    stage.a.state = "hover"
    stage.events.emit(Custom("gone"))
    stage.b.state = "hover"
    stage.step()
    assert stage.phases("team") == ["over"]
    stage.step()
    assert stage.phases("team") == ["over: next", "next"]


def test_a_last_phase_in_turns_ends_when_everybody_had_a_turn() -> None:
    stage = in_turns()
    stage.a.state = "hover"
    stage.step(3)
    assert not stage.flows.ended
    assert stage.b.asked == ["over"]
    stage.b.state = "hover"
    stage.step()
    assert stage.flows.ended


def test_one_that_refuses_passes_its_turn() -> None:
    stage = in_turns(go("next", when=BOTH_HOVER))
    stage.a.state = "brake"
    stage.step()
    assert stage.b.asked == ["over"]


def test_no_turn_outlives_its_phase() -> None:
    stage = in_turns(go("next", event="enough"))
    stage.events.emit(Custom("enough"))
    stage.step(2)
    assert stage.phases("team")[0] == "over: next"
    stage.a.state = "hover"
    stage.step(2)
    assert stage.b.asked == []
