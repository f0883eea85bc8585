"""pause: an overlay; the behavior and its timers stand still, and the same object goes on."""

from __future__ import annotations

import pytest
from failsafe_parts import followed, largest_steps, orders
from plans import after, part, state, then, vehicle
from short_flights import down, hold, hovers, named, path, up

from kybflow.core.signals import NS
from kybflow.dsl.plan import TransitionPlan

PLACE = (0.6, 0.3, 0.8)
FLYING = {
    "circle": {"center": (0.0, 0.0, 0.6), "radius": 0.5, "speed": 0.5, "laps": 1.0},
    "figure_eight": {"width": 1.0, "lap": 8.0, "laps": 1.0},
    "fly_to": {"position": PLACE},
    "follow_path": {"path": ((0.5, 0.0, 0.6), PLACE)},
    "hover": {"for_time": 4.0},
}
QUICK = ("hover",)


def pausing(begin: float, end: float):
    return orders(
        (begin, lambda v: v.requests.pause("operator", "m.yaml:3")),
        (end, lambda v: v.requests.resume("operator")),
    )


def between(told, first: str, second: str) -> float:
    [a], [b] = named(told, first), named(told, second)
    return (b.time - a.time) / NS


def duration(flown, name: str) -> float:
    [visit] = [b for b in flown.summary["vehicles"]["a"]["behaviors"] if b["name"] == name]
    return visit["end_s"] - visit["start_s"]


@pytest.mark.parametrize(
    "name",
    [n if n in QUICK else pytest.param(n, marks=pytest.mark.thorough) for n in FLYING],
)
def test_every_flying_behavior_goes_on_where_it_was(run, name):
    tracker, samples = followed()
    behavior = part("behaviors", name, **FLYING[name])
    states = [up("fly"), state("fly", behavior, then("down")), down()]
    plan = vehicle("a", states, tracker=tracker)
    calm, _ = run(plan)
    still = samples.copy()
    samples.clear()
    flown, told = run(plan, observers=(pausing(5.5, 8.0),))
    assert path(told, "a") == ["up", "fly", "down", "landed"]
    assert [e.fields for e in named(told, "paused", "resumed")] == [{"by": "operator"}] * 2
    assert duration(flown, "fly") >= duration(calm, "fly") + between(told, "paused", "resumed")
    highest = [max(s.position[2] for _, s in one) for one in (still, samples)]
    assert highest[1] == pytest.approx(highest[0], abs=0.01)
    position, velocity = largest_steps(samples)
    assert position <= 1.0 * 0.004
    assert velocity <= 0.02


@pytest.mark.parametrize(
    ("name", "when"), [pytest.param("up", 1.5, marks=pytest.mark.thorough), ("down", 4.5)]
)
def test_a_take_off_and_a_landing_are_paused_too(run, name, when):
    tracker, samples = followed()
    plan = vehicle("a", [up("down"), down()], tracker=tracker)
    calm, _ = run(plan)
    samples.clear()
    flown, told = run(plan, observers=(pausing(when, when + 2.0),))
    assert path(told, "a") == ["up", "down", "landed"]
    assert duration(flown, name) >= duration(calm, name) + 1.9
    assert largest_steps(samples)[0] <= 0.5 * 0.004 + 1e-6


@pytest.mark.thorough
def test_timers_stand_still(run):
    late = TransitionPlan(target="hold", cause="within", after=3.5)
    timed = state("timed", part("behaviors", "hover"), after(3.0, "down"), late)
    states = [up("timed"), timed, hold(9.0, "down"), down()]
    flown, told = run(vehicle("a", states), observers=(pausing(4.5, 12.0),))
    assert path(told, "a") == ["up", "timed", "down", "landed"]
    frozen = duration(flown, "timed") - 3.0
    assert frozen == pytest.approx(between(told, "paused", "resumed"), abs=0.05)


@pytest.mark.thorough
def test_a_pause_that_lasts_lands(run):
    pauses = orders((5.0, lambda v: v.requests.pause("x")))
    flown, told = run(hovers(hover_limit=5.0), observers=(pauses,))
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]
    [paused] = named(told, "paused")
    [last] = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "auto_land"]
    assert (last.time - paused.time) / NS == pytest.approx(5.0, abs=0.01)
    assert "`hold` failed: held for 5 s" in flown.summary["reason"]


@pytest.mark.thorough
def test_a_tight_loop_of_pauses_changes_nothing_but_the_time(run):
    tracker, samples = followed()
    circle = part("behaviors", "circle", **FLYING["circle"])
    pair = (lambda v: v.requests.pause("x"), lambda v: v.requests.resume("x"))
    loop = orders(*((5.0 + 0.05 * i, pair[i % 2]) for i in range(40)))
    states = [up("circle"), state("circle", circle, then("down")), down()]
    flown, told = run(vehicle("a", states, tracker=tracker), observers=(loop,))
    assert path(told, "a") == ["up", "circle", "down", "landed"]
    assert flown.exit_code == 0
    assert len(named(told, "paused")) == len(named(told, "resumed")) == 20
    position, velocity = largest_steps(samples)
    assert position <= 1.0 * 0.004
    assert velocity <= 0.02


@pytest.mark.thorough
def test_pause_and_resume_in_one_tick_is_no_pause(run):
    both = orders((5.0, lambda v: (v.requests.pause("x"), v.requests.resume("x"))))
    flown, told = run(hovers(), observers=(both,))
    assert [e.name for e in named(told, "paused", "resumed")] == ["paused", "resumed"]
    assert duration(flown, "hold") == pytest.approx(4.0, abs=0.05)


@pytest.mark.thorough
def test_a_second_pause_and_a_resume_without_one_say_nothing(run):
    twice = orders(
        (4.5, lambda v: v.requests.resume("x")),
        (5.0, lambda v: (v.requests.pause("x"), v.requests.pause("x"))),
        (6.0, lambda v: (v.requests.resume("x"), v.requests.resume("x"))),
    )
    _, told = run(hovers(), observers=(twice,))
    assert [e.name for e in named(told, "paused", "resumed")] == ["paused", "resumed"]


@pytest.mark.thorough
def test_on_the_ground_a_pause_stops_the_clock_only(run):
    wait = state("wait", part("behaviors", "wait_on_ground"), after(1.0, "up"))
    flier = vehicle("a", [wait, up("down"), down()], hover_limit=5.0)
    flown, told = run(flier, observers=(pausing(0.5, 10.0),))
    assert path(told, "a") == ["wait", "up", "down", "landed"]
    assert duration(flown, "wait") == pytest.approx(10.5, abs=0.1)
