"""A state that is entered with other values of its parameters, by a person."""

from __future__ import annotations

import time
from dataclasses import replace
from math import dist
from types import SimpleNamespace

import pytest
from commanders import Asked, People
from hypothesis import given
from hypothesis import strategies as st
from plans import part, plan, state, vehicle
from short_flights import down, hold, named, path, up

from kybflow.api.opening import PlanEntryJudge
from kybflow.core.errors import Refused
from kybflow.core.signals import SetpointKind
from kybflow.dsl.plan import TransitionPlan
from kybflow.flight.motion import Motion
from kybflow.parts import AIR
from kybflow.recording.earlier_run import read_earlier_run
from kybflow.runtime.behaviors.fly_to import FlyTo
from kybflow.runtime.commanding.orders import parse
from kybflow.runtime.vehicle.requests import NoJudge, Requests
from kybflow.world.shapes import Box

POLE = {"pole": Box((0.9, -1.1, 0.0), (1.1, -0.9, 2.0))}


def goer():
    goto = state("goto", part("behaviors", "fly_to", position=(0.0, 1.0, 1.0)), THEN_HOLD)
    return vehicle("a", [up("hold"), hold(60.0, "down"), goto, down()])


THEN_HOLD = TransitionPlan(target="hold", cause="then")


def answered(run, *asked: tuple[float, str], watch=lambda engine: None, **facts):
    """What was told, and each answer."""
    people = People(*(Asked(seconds, words) for seconds, words in asked))
    observers, servers = (people.look, watch), (people.serve,)
    done, told = run(goer(), observers=observers, servers=servers, obstacles=POLE, **facts)
    return done, told, [(one.answer.accepted, one.answer.reason) for one in people.told]


@pytest.mark.thorough
def test_it_flies_where_it_is_told_and_then_as_the_mission_says(run) -> None:
    seen = []

    def watch(engine):
        [one] = engine.vehicles
        if engine.flying and one.state == "hold" and one.estimate is not None:
            seen.append(one.estimate.position)

    _, told, answers = answered(
        run,
        (5.0, "switch a goto position=[1, 0.5, 1.2] speed=80 cm/s"),
        (11.0, "switch a goto"),
        (17.0, "stop"),
        watch=watch,
    )
    assert answers == [(True, "")] * 3
    started = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "goto"]
    assert [e.fields.get("values") for e in started] == [
        "position (1.0, 0.5, 1.2), speed 0.8",
        None,
    ]
    assert any(dist(place, (1.0, 0.5, 1.2)) < 0.05 for place in seen)
    assert dist(seen[-1], (0.0, 1.0, 1.0)) < 0.05
    assert path(told, "a") == ["up", "hold", "goto", "hold", "goto", "hold", "auto_land", "landed"]


HIGH = (0.0, 0.0, 1.0)
JUDGE = PlanEntryJudge(plan(goer(), obstacles=POLE))


def refusal(written: str, state: str = "goto", at=HIGH) -> str:
    """What is said of a command that enters `goto` at a place."""
    order = parse(f"switch a {state} {written}")
    try:
        values = JUDGE.read("a", state, order.values)
    except Refused as error:
        return str(error)
    params = replace(goer().states[state].behavior.params, **dict(values))
    return JUDGE.objection("a", state, params, [at]) or ""


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ("position=[1, 0, 1] heading=90 deg", ""),
        ("heading=null speed=50 cm/s", ""),
        ("position=[3, 0, 1]", "`goto` (fly_to) leaves the fence: [3, 0, 1] m is 1 m outside"),
        ("position=[1, -1, 1]", "`goto` (fly_to) flies into `pole`: at [1, -1, 1] m, 0.1 m inside"),
        ("speed=20 m/s", "`goto` flies faster than `a` can: reaches 20 m/s"),
        ("speed=1 kg", "`1 kg` is a mass, but a speed is needed; write it like `0.5 m/s`"),
        ("speed=-1 m/s", "`speed` must be above 0 m/s: `-1 m/s`; write it like `1 m/s`"),
        ("position=here", "`position` must be three numbers in a list, `[x, y, z]`"),
        ("position=[1, 0", "`position`: "),
        ("position=world.points.x", "`position`: the world has no point `x`"),
        ("sped=1 m/s", "`sped` is not a parameter of `fly_to`; did you mean `speed`?"),
    ],
)
def test_what_the_compiler_would_refuse_is_refused_in_its_words(values: str, reason: str) -> None:
    said = refusal(values)
    assert said.startswith(reason) if reason else said == ""


@given(
    st.sampled_from(["position", "speed", "heading"]),
    st.text(max_size=40) | st.text("[{*&!#,: 1.em-}]"),
)
def test_whatever_is_written_is_a_value_or_refused(name: str, text: str) -> None:
    try:
        values = JUDGE.read("a", "goto", ((name, text),))
    except Refused:
        return
    assert [name] == [own for own, _ in values]


def test_a_path_is_judged_from_where_it_begins() -> None:
    assert refusal("position=[1.5, -1, 1]") == ""
    assert refusal("position=[1.5, -1, 1]", at=(0.0, -1.0, 1.0)).startswith(
        "`goto` (fly_to) flies into `pole`"
    )


def test_that_a_flow_asks_for_a_state_too_changes_nothing() -> None:
    outside, params = (-2.5, 0.0, 1.0), goer().states["up"].behavior.params
    asked = replace(goer(), requested=frozenset({"up"}), requested_first=frozenset({"up"}))
    for judge in (JUDGE, PlanEntryJudge(plan(asked, obstacles=POLE))):
        assert judge.objection("a", "up", params, [outside]) is None


def test_a_built_in_state_takes_no_values() -> None:
    assert refusal("for_time=3 s", "hover") == "`hover` is built in and takes no values"


def test_a_point_of_the_world_is_a_place() -> None:
    mission = plan(goer(), points={"there": (1.0, 0.5, 1.0)})
    written = (("position", "world.points.there"),)
    assert PlanEntryJudge(mission).read("a", "goto", written) == (("position", (1.0, 0.5, 1.0)),)


def test_who_is_in_motion_is_judged_from_where_it_comes_to_rest() -> None:
    """It would coast into the pole from where it may go at rest."""
    asked = []

    class Judge:
        def objection(self, vehicle, state, params, points):
            asked.append((params.position, points))
            return "no"

    entry = SimpleNamespace(motion=Motion((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    params = goer().states["goto"].behavior.params
    runner = SimpleNamespace(
        entry=lambda: entry, params_of=lambda _, values: replace(params, **dict(values))
    )
    requests = Requests(goer(), None, runner, None, None, None, Judge(), None)
    goal = (("position", (1.0, 0.0, 1.0)),)
    assert requests._misled(goer().states["goto"], goal) == "no"
    [(position, (here, there))] = asked
    assert (position, here) == ((1.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    assert there[0] > 0.3


@pytest.mark.thorough
def test_an_option_that_changes_meanwhile_leaves_the_other_values(run) -> None:
    goals = []

    def watch(engine):
        [one] = engine.vehicles
        if engine.flying and one.state == "goto":
            params = one.runner.behavior.params
            goals.append((params.position, params.dwell))

    answered(
        run,
        (5.0, "switch a goto position=[1, 0.5, 1.2]"),
        (6.0, "set a.behaviors.goto.dwell 1 s"),
        (14.0, "stop"),
        watch=watch,
    )
    assert {position for position, _ in goals} == {(1.0, 0.5, 1.2)}
    assert goals[0][1] == 0.3
    assert goals[-1][1] == 1.0


@pytest.mark.thorough
def test_it_is_flown_again_from_its_record(run, tmp_path) -> None:
    asked = ((5.0, "switch a goto position=[1, 0.5, 1.2]"), (9.0, "stop"))
    first, told, _ = answered(run, *asked)
    again = read_earlier_run(first.folder).commands
    _, retold = run(goer(), obstacles=POLE, again=again)
    assert [(e.time, e.name, e.fields) for e in retold] == [
        (e.time, e.name, e.fields) for e in told
    ]


class Fragile(FlyTo, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """As a lab's own behavior may be."""

    def __init__(self, params, entry) -> None:
        super().__init__(params, entry)
        if params.dwell > 1.0:
            raise ZeroDivisionError("too patient")

    @classmethod
    def footprint(cls, params, entry):
        return super().footprint(params, entry) if params.patience < 20.0 else 1 / 0

    @classmethod
    def objection(cls, params, entry):
        return "too careless" if params.tolerance > 0.2 else None


@pytest.mark.thorough
def test_a_part_that_raises_with_values_or_speaks_against_them_is_not_entered(run) -> None:
    fragile = replace(part("behaviors", "fly_to", position=(0.0, 1.0, 1.0)), cls=Fragile)
    states = [up("hold"), hold(60.0, "down"), state("goto", fragile, THEN_HOLD), down()]
    people = People(
        Asked(5.0, "switch a goto dwell=2 s"),
        Asked(5.1, "switch a goto patience=20 s"),
        Asked(5.2, "switch a goto tolerance=30 cm"),
        Asked(5.3, "stop"),
    )
    _, told = run(vehicle("a", states), observers=(people.look,), servers=(people.serve,))
    first, second, third = (one.answer for one in people.told[:3])
    assert not any(answer.accepted for answer in (first, second, third))
    assert "too patient" in first.reason
    assert third.reason == "too careless"
    assert second.reason == "ZeroDivisionError: division by zero"
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]


def test_where_nobody_can_judge_no_value_is_taken() -> None:
    requests = Requests(goer(), None, None, None, None, None, NoJudge(), None)
    assert requests.read("goto", ()) == ()
    with pytest.raises(Refused, match="values can't be checked here"):
        requests.read("goto", (("speed", "1 m/s"),))


def test_judging_takes_a_small_part_of_a_tick() -> None:
    judge = PlanEntryJudge(plan(goer(), obstacles=POLE))
    params = goer().states["goto"].behavior.params
    judge.objection("a", "goto", params, [(0.0, 0.0, 1.0)])
    began = time.process_time()
    for _ in range(20):
        judge.read("a", "goto", (("position", "[1, 0, 1]"),))
        judge.objection("a", "goto", params, [(0.0, 0.0, 1.0), (0.1, 0.0, 1.0)])
    assert (time.process_time() - began) / 20 < 0.02
