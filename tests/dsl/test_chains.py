"""Chains, stacks and worlds, by what they leave in the plan."""

from __future__ import annotations

from pathlib import Path

from toolchain import compiled

from kybflow.dsl.expressions import Always, Compare, Distance, InState, Location, Not
from kybflow.dsl.graph.drawing import cause_of
from kybflow.dsl.plan import Plan, StatePlan
from kybflow.world.shapes import Cylinder, Plane

LAB = """
library: lab
import: {std: kybflow/airframes}
parameters: {cruise: {type: speed, default: 50 cm/s}}
chains:
  there:
    parameters: {goal: {type: position}, wait: {type: duration, default: 1 s}}
    behaviors:
      over: {do: fly_to, position: $goal, speed: $cruise, then: stay, within: 20 s}
      stay: {do: hover, for_time: $wait, next: [{when: elapsed > $wait, go: end}]}
  both:
    parameters: {a: {type: position}, b: {type: position}}
    begin: first
    behaviors:
      second: {do: chain.there, goal: $b, wait: 2 s, then: end}
      first:  {do: chain.there, goal: $a, then: second, failed: hover}
stacks:
  slow: {processors: [{use: limit_speed, speed: $cruise}]}
  safe: {processors: [{stack: slow}, fence], supervisors: [{use: battery, land_below: 20 %}]}
worlds:
  hall:
    fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}
    points: {dock: [1, 0, 1], pad: [0, 0, 0]}
    obstacles:
      pillar: {cylinder: {at: [0, 1, 0], radius: 10 cm, height: 2 m}}
      wall:   {plane: {at: [0, -2, 0], facing: [0, 2, 0]}}
vehicles:
  scout:
    like: std.nano_plus
    processors: [{stack: safe}]
    supervisors: [{stack: safe}]
    behaviors:
      up:   {do: take_off, height: 1 m, then: tour}
      tour: {do: chain.both, a: [1, 0, 1], b: [0, 0, 1], then: down, failed: brake, within: 60 s}
      down: {do: land}
"""
MISSION = """
kybflow: 1
mission: m
import: {lab: {from: lab.yaml, with: {cruise: 60 cm/s}}}
parameters: {goal: {type: position, default: world.points.dock}}
world: {like: lab.hall, points: {pad: [0, 0.2, 0]}, obstacles: {pillar: null}}
vehicles:
  a:
    like: lab.scout
    start: {at: world.points.pad}
    home: world.points.pad
    behaviors:
      tour: {a: $goal, next: [{after: 50 s, event: landed, go: tour}]}
expect:
  - always distance(a to world.points.dock) < 3 m
  - eventually a.behavior == tour.first
  - finally a.behavior != tour
"""


def plan_of(folder: Path, *sets: str) -> Plan:
    (folder / "lab.yaml").write_text(LAB)
    return compiled(folder / "mission.yaml", MISSION, sets=sets)


def states(plan: Plan) -> dict[str, StatePlan]:
    return {n: s for n, s in plan.vehicles[0].states.items() if not s.built_in}


def arrows(state: StatePlan) -> list[tuple[str, str]]:
    return [(cause_of(arrow), arrow.target) for arrow in state.transitions]


def test_a_chain_becomes_its_states_the_first_on_top(tmp_path: Path) -> None:
    assert list(states(plan_of(tmp_path))) == [
        "up",
        "tour.first.over",
        "tour.first.stay",
        "tour.second.over",
        "tour.second.stay",
        "down",
    ]


def test_an_arrow_to_a_chain_enters_its_first_state(tmp_path: Path) -> None:
    up = states(plan_of(tmp_path))["up"]
    assert [(t.target, t.enters) for t in up.transitions if t.cause == "then"] == [
        ("tour.first.over", "tour")
    ]


def test_ends_failures_and_bounds_are_those_of_the_uses(tmp_path: Path) -> None:
    inside = states(plan_of(tmp_path))
    assert arrows(inside["tour.first.over"]) == [
        ("event landed after 50 s in tour", "tour.first.over"),
        ("done", "tour.first.stay"),
        ("failed", "hover"),
        ("not done within 20 s", "hover"),
        ("tour not done within 60 s", "brake"),
    ]
    assert arrows(inside["tour.second.stay"]) == [
        ("event landed after 50 s in tour", "tour.first.over"),
        ("elapsed > 2 s", "down"),
        ("done", "down"),
        ("failed", "brake"),
        ("tour not done within 60 s", "brake"),
    ]


def test_parameters_come_from_the_use_and_from_the_library(tmp_path: Path) -> None:
    inside = states(plan_of(tmp_path))
    first = inside["tour.first.over"].behavior.params
    assert (first.position, first.speed) == ((1.0, 0.0, 1.0), 0.6)
    assert inside["tour.second.over"].behavior.params.position == (0.0, 0.0, 1.0)
    assert inside["tour.first.stay"].behavior.params.for_time == 1.0
    moved = states(plan_of(tmp_path, "goal=[0, 1, 1]"))["tour.first.over"]
    assert moved.behavior.params.position == (0.0, 1.0, 1.0)


def test_a_state_inside_says_where_it_is_written(tmp_path: Path) -> None:
    over = states(plan_of(tmp_path))["tour.first.over"]
    assert over.at.endswith("lab.yaml:9")
    assert over.behavior.label == "behaviors.tour.first.over"


def test_stacks_stand_for_their_parts(tmp_path: Path) -> None:
    vehicle = plan_of(tmp_path).vehicles[0]
    assert [p.name for p in vehicle.processors] == ["limit_speed", "fence"]
    assert vehicle.processors[0].params.speed == 0.6
    assert next(s for s in vehicle.supervisors if s.name == "battery").params.land_below == 0.2


def test_a_world_may_be_like_one_of_a_library(tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    assert plan.points == {"dock": (1.0, 0.0, 1.0), "pad": (0.0, 0.2, 0.0)}
    assert plan.obstacles == {"wall": Plane((0.0, -2.0, 0.0), (0.0, 1.0, 0.0))}
    assert (plan.vehicles[0].start, plan.vehicles[0].home) == ((0.0, 0.2, 0.0),) * 2


def test_a_world_may_be_one_of_a_library(tmp_path: Path) -> None:
    (tmp_path / "lab.yaml").write_text(LAB)
    text = MISSION.replace(
        "{like: lab.hall, points: {pad: [0, 0.2, 0]}, obstacles: {pillar: null}}", "lab.hall"
    )
    (tmp_path / "mission.yaml").write_text(text)
    plan = compiled(tmp_path / "mission.yaml")
    assert plan.obstacles["pillar"] == Cylinder((0.0, 1.0, 0.0), 0.1, 2.0)


def test_expressions_know_points_and_chains(tmp_path: Path) -> None:
    near, inside, outside = (e.expression for e in plan_of(tmp_path).expectations)
    assert isinstance(near, Always)
    assert isinstance(near.condition, Compare)
    assert near.condition.left == Distance(Location("a"), Location(None, point=(1.0, 0.0, 1.0)))
    assert getattr(inside, "condition", None) == InState("a", "tour.first")
    assert getattr(outside, "condition", None) == Not(InState("a", "tour"))


def test_the_resolved_mission_reads_back_as_the_same_states(tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    again = compiled(tmp_path / "resolved.yaml", plan.resolved)
    assert {n: arrows(s) for n, s in states(again).items()} == {
        n: arrows(s) for n, s in states(plan).items()
    }


def test_a_header_of_the_resolved_mission_has_the_place_of_its_key(tmp_path: Path) -> None:
    lines = plan_of(tmp_path).resolved.splitlines()
    origins = {line.split(":")[0]: line.rsplit("# ", 1)[1] for line in lines}
    assert origins["    processors"].endswith("lab.yaml:30")
    assert origins["    behaviors"].endswith("mission.yaml:12")
    assert origins["    estimators"].endswith("defaults.yaml:6")
