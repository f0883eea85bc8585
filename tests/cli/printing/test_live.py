"""The live table of several vehicles: phases, what is waited for, and who is nearest."""

from __future__ import annotations

from io import StringIO
from typing import Any

import pytest
from plans import part, state, vehicle
from rich.console import Console
from short_flights import down, hold, up

from kybflow.cli.printing.live import LivePanel
from kybflow.dsl.plan import FlowPlan, PhasePlan, Request, TransitionPlan


def member(name: str, start: float, come_after: float) -> Any:
    """One that flies in formation once it has hovered for `come_after` seconds."""
    formed = part("behaviors", "formation", members="pair", side=0.8)
    leave = TransitionPlan(target="down", after=6.0)
    idle = state("idle", part("behaviors", "wait_on_ground"))
    line = state("line", formed, leave, TransitionPlan(target="down", cause="failed"))
    return vehicle(
        name, [idle, up("hold"), hold(come_after, "line"), line, down()], start=(start, 0.0, 0.0)
    )


@pytest.mark.thorough
@pytest.mark.parametrize("width", [80, pytest.param(120, marks=pytest.mark.slow)])
def test_it_shows_the_phase_what_is_waited_for_and_who_is_nearest(run: Any, width: int) -> None:
    requests = {"a": Request("up"), "b": Request("up")}
    phase = PhasePlan(name="launch", run=requests, give={}, options=(), transitions=())
    flow = FlowPlan(name="team", begin="launch", vehicles=("a", "b"), phases={"launch": phase})
    shown: list[str] = []

    def sees(engine: Any) -> None:
        file = StringIO()
        console = Console(file=file, width=width)
        console.print(LivePanel(console).drawing(engine, 1.0))
        shown.append(file.getvalue())

    pair = (member("a", -0.5, 0.1), member("b", 0.5, 2.0))
    run(*pair, observers=(sees,), groups={"pair": ("a", "b")}, flows=(flow,))
    assert any("phases     team launch 2 s\n" in table for table in shown)
    waiting = [table for table in shown if "waiting    a for `b` to come\n" in table]
    assert any(" 1.00 m b │" in table for table in waiting)
    assert any(" 0.80 m a │" in table for table in shown)
    assert max(len(line) for table in shown for line in table.splitlines()) <= width
