"""What a run has taken of its mission, told by its events."""

from plans import part, plan, state, vehicle

from kybflow.campaigns.cases import (
    CoverageListener,
    StateItem,
    TransitionItem,
    coverage_items,
    covered,
)
from kybflow.core.signals import Event
from kybflow.dsl.plan import TransitionPlan


def told(*events: tuple[str, dict[str, str], str]) -> set[StateItem | TransitionItem]:
    traces = CoverageListener()
    for time, (name, fields, at) in enumerate(events):
        traces.on_event(Event(time, name, "a", dict(fields), at))
    return traces.taken


def started(name: str) -> tuple[str, dict[str, str], str]:
    return "behavior_started", {"behavior": name}, ""


def ended(name: str, how: str, at: str = "m.yaml:3") -> tuple[str, dict[str, str], str]:
    return "behavior_ended", {"behavior": name, "how": how}, at


def test_the_first_state_has_no_arrow():
    assert told(started("up")) == {StateItem("a", "up")}


def test_a_normal_end_takes_the_arrow_then():
    expected = {
        StateItem("a", "up"),
        StateItem("a", "hold"),
        TransitionItem("a", "up", "then", "hold", "m.yaml:3"),
    }
    assert told(started("up"), ended("up", "done"), started("hold")) == expected


def test_a_refusal_takes_the_arrow_failed():
    taken = told(started("up"), ended("up", "refused", ""), started("home"))
    assert TransitionItem("a", "up", "failed", "home", "") in taken


def test_what_was_not_taken_is_missed_in_the_missions_order():
    everything = [
        StateItem("a", "up", "m.yaml:3"),
        TransitionItem("a", "up", "then", "hold", "m.yaml:3"),
        TransitionItem("a", "up", "within", "auto_land", "m.yaml:4"),
        StateItem("a", "hold", "m.yaml:5"),
    ]
    coverage = covered(everything, told(started("up"), ended("up", "done"), started("hold")))
    assert coverage.missed == (everything[2],)
    assert coverage.share == 0.75


def test_two_arrows_of_one_line_with_one_goal_count_once():
    arrows = [TransitionPlan(target="down", after=t, at="m.yaml:3") for t in (1.0, 2.0)]
    hold = state("hold", part("behaviors", "hover"), *arrows, at="m.yaml:3")
    expected = [
        StateItem("a", "hold", "m.yaml:3"),
        TransitionItem("a", "hold", "next", "down", "m.yaml:3"),
    ]
    assert coverage_items(plan(vehicle("a", [hold]))) == expected
