"""A matrix of gains in flight: each direction gives way to a push as its gain says."""

from __future__ import annotations

from pathlib import Path
from statistics import mean

import pytest
from plans import in_still_air, part, plan, vehicle
from short_flights import down, hold, named, up
from toolchain import compiled, flight_of

from kybflow.core.geometry import Vec3, sub
from kybflow.core.signals import NS
from kybflow.dsl.plan import FaultPlan

PUSH, PUSHED = 0.4, 8.0
"""m/s^2 along x and y, and from which second on."""
Rows = tuple[Vec3, Vec3, Vec3]


def diagonal(x: float, y: float, z: float) -> Rows:
    return ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))


def errors(run, **gains) -> list[tuple[float, Vec3]]:
    """(seconds, metres from its place) of a vehicle that hovers and is pushed."""
    seen = []

    def look(engine):
        hovering = engine.vehicles[0]
        if engine.flying and hovering.state == "hold":
            off = sub(hovering.truth.position, hovering.followed.position)
            seen.append((engine.clock.now / NS, off))

    tracker = part("trackers", "cascade", integral=0.0, **gains)
    hovers = vehicle("a", [up("hold", 1.0), hold(22.0, "down"), down()], tracker=tracker)
    hovers = in_still_air(plan(hovers)).vehicles[0]
    push = part("faults", "push", acceleration=(PUSH, PUSH, 0.0))
    pushed = FaultPlan(part=push, vehicle="a", time=PUSHED, when=None, duration=None, at="m:9")
    flown, _ = run(hovers, faults=(pushed,), observers=(look,))
    assert flown.summary["outcome"] == "succeeded", flown.summary
    return seen


def given_way(seen: list[tuple[float, Vec3]]) -> tuple[float, float]:
    """How far along x and y in the end."""
    late = [off for t, off in seen if t > PUSHED + 12.0]
    return mean(x for x, _, _ in late), mean(y for _, y, _ in late)


@pytest.mark.parametrize(
    ("gain", "x_over_y"),
    [
        (diagonal(4.0, 9.0, 9.0), 9.0 / 4.0),
        (((6.0, 3.0, 0.0), (3.0, 9.0, 0.0), (0.0, 0.0, 9.0)), 6.0 / 3.0),
        (diagonal(9.0, 9.0, 4.0), 1.0),
    ],
    ids=["apart", "coupled", "alike"],
)
def test_it_gives_way_until_the_gains_pull_against_the_push(run, gain: Rows, x_over_y) -> None:
    """The push is along the diagonal of x and y: where the gain times the way is, too."""
    x, y = given_way(errors(run, position_gain=gain))
    assert x / y == pytest.approx(x_over_y, rel=0.05)
    assert y > 0.02


def test_the_scalars_own_diagonal_flies_the_same(run) -> None:
    assert errors(run, position_gain=diagonal(9.0, 9.0, 9.0)) == errors(run)


SOFTENED = """
kybflow: 1
mission: softened
import: {std: kybflow/airframes}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  a:
    like: std.nano_plus
    tracker: {use: cascade, integral: 0}
    behaviors:
      up:   {do: take_off, height: 1 m, then: hold}
      hold: {do: hover, for_time: 4 s, then: down}
      down: {do: land}
on:
  - event: a.behavior_started
    behavior: hold
    do: [{set: {a.tracker.position_gain: [[4, 1, 0], [1, 9, 0], [0, 0, 9]]}}]
"""


def test_a_callback_sets_it_in_flight(tmp_path: Path) -> None:
    mission, gains = tmp_path / "softened.yaml", set()
    plan = compiled(mission, SOFTENED)

    def look(engine):
        [flying] = engine.vehicles
        gains.add(flying.parameters()["tracker"].position_gain)

    flown, told = flight_of(plan, tmp_path / "run", look)
    assert flown.summary["outcome"] == "succeeded", flown.summary
    assert gains == {None, ((4.0, 1.0, 0.0), (1.0, 9.0, 0.0), (0.0, 0.0, 9.0))}
    [changed] = named(told, "option_changed")
    assert changed.fields["option"] == "a.tracker.position_gain"
    assert named(told, "option_refused") == []
