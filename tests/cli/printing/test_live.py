"""The live table: phases, what is waited for, positions, the nearest vehicle, the time left, and
the keys that steer."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import StringIO
from typing import Any

import pytest
from plans import bent, part, state, vehicle
from rich.console import Console
from short_flights import down, hold, hovers, up

from kybflow.cli.printing.flights import EventLines
from kybflow.cli.printing.live import LivePanel
from kybflow.dsl.plan import FlowPlan, InputPlan, PhasePlan, Request, TransitionPlan
from kybflow.inputs.rows import InputRow, head, line
from kybflow.parts import AXES


def drawn(make: Callable[[Console], LivePanel], shown: dict[float, str]) -> Callable[[Any], None]:
    """An observer that keeps what the panel shows two wall seconds after the start, ten times a
    second."""

    def sees(engine: Any) -> None:
        if (seconds := round(engine.seconds(), 1)) not in shown:
            console = Console(file=StringIO(), width=110)
            console.print(make(console).drawing(engine, 2.0))
            shown[seconds] = console.file.getvalue()

    return sees


def test_it_shows_the_time_left_by_the_rehearsal_or_else_by_the_limit(run: Any) -> None:
    limited, rehearsed = dict[float, str](), dict[float, str]()
    observers = (
        drawn(LivePanel, limited),
        drawn(lambda console: LivePanel(console, None, 6.0), rehearsed),
    )
    run(hovers(2.0, height=0.3), observers=observers, time_limit=200.0)
    assert "  2.0 s   1.0 x   at most 3 min to the time limit " in limited[2.0]
    assert re.search(r"  4\.0 s   2\.0 x   at most (98|99) s to the time limit ", limited[4.0])
    assert re.search(r"  4\.0 s   2\.0 x   about [12] s left ", rehearsed[4.0])
    last = max(rehearsed)
    assert " to the time limit " in rehearsed[last], "it takes longer than the rehearsal did"
    assert not re.search("left|limit", limited[0.0]), "nothing flies during the preflight"


def test_it_shows_the_keys_of_a_keyboard_that_steers(run: Any) -> None:
    keys = InputPlan(
        name="keys", part=part("inputs", "keyboard"), buttons={"go": "g"}, button_names={"go": "g"}
    )
    said = {"keys": head(AXES) + line(InputRow(0, dict.fromkeys(AXES, 0.0)), AXES)}
    shown = dict[float, str]()
    run(hovers(0.2), observers=(drawn(LivePanel, shown),), inputs=(keys,), said=said)
    words = "w s climb and sink, a d turn, arrows fly, space stops, g go, Ctrl-C lands"
    assert f"keys       {words}\n" in shown[max(shown)]


def test_every_red_check_is_shown_in_full(run: Any) -> None:
    screen, told = StringIO(), list[str]()
    silent = bent(lambda measurement, now: None)
    fleet = [vehicle(name, [up("down"), down()], driver=silent) for name in "abc"]
    with LivePanel(Console(file=screen, width=60)) as panel:
        listeners = (EventLines(told.append), EventLines(panel.line))
        run(*fleet, observers=(panel.on_tick,), listeners=listeners)
    red = [line for line in told if "preflight_failed" in line]
    assert len(red) > 6
    shown = re.sub(r"\s+", "", screen.getvalue())
    assert [line for line in red if re.sub(r"\s+", "", line) not in shown] == []


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
    assert any(re.search(r"│ +-0.5\d 0.00 0.\d\d │ 1.00 m b│", table) for table in waiting)
    assert any(" 0.80 m a│" in table for table in shown)
    assert max(len(line) for table in shown for line in table.splitlines()) <= width
