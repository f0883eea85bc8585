"""Drawings of state machines."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations
from typing import Any
from xml.etree import ElementTree

import pytest
from plans import part, plan, state, then, vehicle

from kybflow.core.units import RATIO
from kybflow.dsl.expressions import Compare, Quantity, Read
from kybflow.dsl.graph.drawing import Edge, drawings, mermaid
from kybflow.dsl.graph.svg import Size, arranged, svg
from kybflow.dsl.plan import (
    CallbackPlan,
    FlowPlan,
    PhasePlan,
    Plan,
    Request,
    StatePlan,
    Switch,
    TransitionPlan,
)

LOW = Compare("<", Read(None, "battery.remaining"), Quantity(0.3, RATIO))
HOME = TransitionPlan(target="down", when=LOW, hold=0.5)
LATE = TransitionPlan(target="brake", cause="within", after=9.0)
IMPLIED = TransitionPlan(target="brake", cause="failed", implied=True)


def flying_states() -> list[StatePlan]:
    hover = part("behaviors", "hover")
    return [
        state("up", part("behaviors", "take_off", height=1.0), then("go"), IMPLIED),
        state("go", hover, then("back"), HOME, LATE),
        state("back", hover, then("go"), HOME),
        state("down", part("behaviors", "land"), replace(then("landed"), implied=True)),
    ]


def phase(name: str, *transitions: TransitionPlan, **asked: Any) -> PhasePlan:
    facts = {"run": {}, "give": {}, **asked}
    return PhasePlan(name=name, options=(), transitions=transitions, **facts)


def flow(name: str, vehicles: str, *phases: PhasePlan) -> FlowPlan:
    own = {one.name: one for one in phases}
    return FlowPlan(name=name, begin=phases[0].name, vehicles=tuple(vehicles), phases=own)


@pytest.fixture
def twins() -> Plan:
    return plan(vehicle("a", flying_states()), vehicle("b", flying_states()))


def test_vehicles_with_one_machine_share_a_drawing(twins: Plan) -> None:
    assert [drawing.title for drawing in drawings(twins)] == ["a, b"]
    short = [
        state("up", part("behaviors", "take_off", height=1.0), then("down")),
        flying_states()[3],
    ]
    other = plan(vehicle("a", flying_states()), vehicle("b", short))
    assert [drawing.title for drawing in drawings(other)] == ["a", "b"]


def test_built_in_states_are_drawn_where_an_arrow_leads(twins: Plan) -> None:
    drawing = drawings(twins)[0]
    built_in = {box.name for box in drawing.boxes if box.is_built_in}
    assert {"brake", "hover", "auto_land", "landed"} == built_in
    assert Edge("up", "brake", (), True) not in drawing.edges


def test_arrows_say_why_they_are_taken(twins: Plan) -> None:
    edges = {(e.source, e.target): e for e in drawings(twins)[0].edges}
    assert edges["go", "down"].labels == ("battery.remaining < 30 % for 500 ms",)
    assert edges["go", "brake"].labels == ("not done within 9 s",)
    assert edges["go", "back"].labels == ("done",)
    assert edges["down", "landed"].is_implied


def test_mermaid(twins: Plan) -> None:
    text = mermaid(twins)
    assert text.startswith("---\ntitle: test\n---\nstateDiagram-v2\n")
    assert '    state "up<br>take_off, ground → air" as m1s1\n' in text
    assert "    m1s2 --> m1s4 : battery.remaining #lt; 30 % for 500 ms\n" in text
    assert text.count("[*] -->") == 1


def test_the_picture_is_well_formed_and_needs_nothing(twins: Plan) -> None:
    text = svg(twins)
    root = ElementTree.fromstring(text)
    words = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"test", "a, b", "up", "take_off · ground → air", "done"} <= set(words)
    assert re.findall(r"href|@import|<script|url\((?!#)", text) == []
    assert text == svg(twins)


def test_names_are_escaped() -> None:
    wild = state("<b>&", part("behaviors", "take_off", height=1.0))
    assert "<b>&" in "".join(ElementTree.fromstring(svg(plan(vehicle("a", [wild])))).itertext())


GRAPHS = [
    (3, [(0, 1), (1, 2)]),
    (4, [(0, 1), (0, 2), (1, 3), (2, 3), (0, 3)]),
    (5, [(0, 1), (1, 2), (2, 1), (2, 3), (3, 0), (1, 4), (2, 4), (3, 4)]),
    (3, [(0, 1), (1, 0)]),
    (4, [(0, 1), (2, 3)]),
    (1, []),
]


@pytest.mark.parametrize(("count", "edges"), GRAPHS)
def test_nothing_overlaps(count: int, edges: list[tuple[int, int]]) -> None:
    layout = arranged([Size(60, 60, 46)] * count, edges, [Size(6, 150, 19)] * len(edges), 0)
    extents = [
        (x - s.left, x + s.right, y - s.height / 2, y + s.height / 2)
        for x, y, s in zip(layout.x, layout.y, layout.sizes, strict=True)
    ]
    for a, b in combinations(extents, 2):
        assert a[1] <= b[0] + 1e-6 or b[1] <= a[0] + 1e-6 or a[3] <= b[2] or b[3] <= a[2]


@pytest.mark.parametrize(("count", "edges"), GRAPHS)
def test_arrows_point_down_but_for_those_that_close_a_cycle(
    count: int, edges: list[tuple[int, int]]
) -> None:
    layout = arranged([Size(60, 60, 46)] * count, edges, [Size(6, 50, 19)] * len(edges), 0)
    for (source, target), chain in zip(edges, layout.chains, strict=True):
        assert chain.is_reversed == (layout.y[source] > layout.y[target])


def test_a_flow_is_a_machine_of_its_own(twins: Plan) -> None:
    run = {"a": Request("up"), "b": Request("up")}
    later = TransitionPlan(target="land", after=2.0)
    launch = phase("launch", later, run=run, give={"c": "solo"})
    team = flow("team", "abc", launch, phase("land", run={"a": Request("down")}))
    drawing = drawings(replace(twins, flows=(team,), groups={"both": ("a", "b")}))[-1]
    assert drawing.title == "flow team"
    assert [box.part for box in drawing.boxes] == [
        "both: up · c to solo",
        "a: down",
        "the flow is over",
    ]
    assert drawing.edges == (
        Edge("launch", "land", ("after 2 s",), False),
        Edge("land", "end", ("done",), False),
    )
    drawn = replace(twins, flows=(team,))
    assert "launch<br>a, b#58; up" in mermaid(drawn)
    ElementTree.fromstring(svg(drawn))


def asked_for() -> Plan:
    """`a` flies what a flow and a callback ask for; `b` has the same machine, asked by nobody."""
    run = {"a": Request("go")}
    team = flow("team", "a", phase("fly", run=run), phase("again", run=run))
    home = CallbackPlan(
        event="battery_low", vehicles=("a",), actions=(Switch("a", "down"), Switch("a", "fault"))
    )
    twins = plan(vehicle("a", flying_states()), vehicle("b", flying_states()))
    return replace(twins, flows=(team,), callbacks=(home,))


def test_what_flows_and_callbacks_ask_for_has_an_arrow() -> None:
    a, b, _ = drawings(asked_for())
    assert [box.name for box in a.boxes if box.is_asker] == ["flow team", "on battery_low"]
    assert [(edge.source, edge.target) for edge in a.edges if edge.is_request] == [
        ("flow team", "go"),
        ("on battery_low", "down"),
        ("on battery_low", "fault"),
    ]
    assert (a.title, b.title) == ("a", "b")
    assert not any(box.is_asker for box in b.boxes)


def test_who_asks_stands_in_both_forms() -> None:
    text = mermaid(asked_for())
    assert re.search(r'state "flow team<br>asks.*" as m1s(\d+)\n', text)
    assert text.count(" : asks\n") == 3
    assert 'class="edge asked"' in svg(asked_for())


def test_the_dot_of_the_beginning_has_room_of_its_own(twins: Plan) -> None:
    """It stands left of the box, where no arrow arrives."""
    root = ElementTree.fromstring(svg(twins))
    space = "{http://www.w3.org/2000/svg}"
    [dot] = root.iter(f"{space}circle")
    boxes = [r for r in root.iter(f"{space}rect") if r.get("class")]
    first = min(boxes, key=lambda r: abs(float(r.get("x")) - float(dot.get("cx"))))
    assert float(dot.get("cx")) + 5 < float(first.get("x"))
    assert float(dot.get("cy")) == pytest.approx(float(first.get("y")) + 23, abs=0.1)


def test_many_machines_stand_in_rows() -> None:
    wide = phase("x" * 40, run={"a": Request("go")})
    flows = tuple(flow(f"f{n}", "a", wide) for n in range(8))
    text = svg(replace(asked_for(), flows=flows))
    width = re.search(r'width="(\d+)"', text)
    assert width is not None
    assert int(width[1]) <= 1760 + 28
    places = re.findall(r"translate\(([\d.]+) ([\d.]+)\)", text)
    assert len(set(places)) == 10
    assert len({y for _, y in places}) > 1
