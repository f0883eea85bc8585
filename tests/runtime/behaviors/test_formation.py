"""Formations of ideal vehicles that hear each other late: they meet, keep their distances, wait for
who is lost, and go on with who comes and without who leaves."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import combinations
from typing import Any

import pytest
from part_bench import SITE, at_rest, estimate

from kybflow.core.events import Emitting
from kybflow.core.geometry import ZERO, Vec3, add, distance
from kybflow.core.signals import NS, Done, Failed, InputReading, NeighbourState, Setpoint, Tick
from kybflow.flight.formation.places import centroid
from kybflow.parts import AXES, Entry
from kybflow.runtime.behaviors.follow import Follow, FollowParams
from kybflow.runtime.behaviors.formation import Formation, FormationParams
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.world.shapes import Box

DT = 0.02
PLACES: dict[str, Vec3] = {
    "a": (1.0, 1.2, 1.0), "b": (-1.1, 0.8, 1.1), "c": (-0.9, -1.0, 0.9), "d": (1.0, -0.9, 1.0),
}  # fmt: skip
TEAM = {"swarm": tuple(PLACES), "trio": ("a", "b", "c")}
CENTRED = dict.fromkeys(AXES, 0.0)


class Swarm:
    """Vehicles that are always on their setpoints, or `off` by something."""

    def __init__(self, **own: Any) -> None:
        self.now, self.air = 0, Broadcasts()
        self.own = {"members": "swarm", "shape": "square", "delay": 0.02, **own}
        self.flown: dict[str, Any] = {}
        self.setpoints = {name: at_rest(place) for name, place in PLACES.items()}
        self.off = dict.fromkeys(PLACES, ZERO)
        self.events: list[tuple[str, str, dict[str, Any]]] = []
        self.ends: dict[str, Done | Failed] = {}

    def entry(self, name: str, sticks: dict[str, float]) -> Entry:
        place = SITE._replace(
            vehicle=name, groups=TEAM, diameters=dict.fromkeys(PLACES, 0.19), dt=DT,
            fence=Box((-4.0, -4.0, 0.0), (4.0, 4.0, 3.0)),
        )  # fmt: skip
        known = estimate(self.place(name), self.setpoints[name].velocity or ZERO, self.now)
        inputs = {"stick": InputReading(self.now, sticks)}
        return Entry(self.now, place, known, self.setpoints[name], 2.0, inputs=inputs)

    def place(self, name: str) -> Vec3:
        return add(self.setpoints[name].position or ZERO, self.off[name])

    def enter(self, names: Collection[str] = "abcd", **more: Any) -> None:
        for name in names:
            params = FormationParams(**{**self.own, **more})
            self.flown[name] = Formation(params, self.entry(name, CENTRED))

    def fly(self, seconds: float, silent: Collection[str] = (), **sticks: float) -> None:
        for _ in range(round(seconds / DT)):
            self.now += round(DT * NS)
            inputs = {"stick": InputReading(self.now, {**CENTRED, **sticks})}
            for name, behavior in self.flown.items():
                velocity = self.setpoints[name].velocity or ZERO
                known = estimate(self.place(name), velocity, self.now)
                elapsed = self.now / NS
                tick = Tick(
                    self.now, DT, elapsed, known, None, self.setpoints[name], {},
                    inputs=inputs, neighbours=self.air,
                )  # fmt: skip
                self.take(name, behavior.update(tick))
            for name in PLACES:
                if name not in silent:
                    said = self.flown[name].says if name in self.flown else None
                    known = estimate(self.place(name), ZERO, self.now)
                    news = NeighbourState(self.now, known, self.setpoints[name], said)
                    self.air.note(name, news)

    def take(self, name: str, output: Setpoint | Emitting | Done | Failed) -> None:
        if isinstance(output, Emitting):
            self.events.append((name, output.event.name, output.event.recorded()))
            output = output.output
        if isinstance(output, Done | Failed):
            self.ends[name] = output
            output = output.setpoint
        self.setpoints[name] = output

    def told(self, event: str) -> list[tuple[str, dict[str, Any]]]:
        return [(name, fields) for name, what, fields in self.events if what == event]

    def speed(self) -> float:
        return max(distance(self.setpoints[n].velocity or ZERO, ZERO) for n in self.flown)


def formed(**own: Any) -> Swarm:
    """A swarm after its first eight seconds, in which its members take their places."""
    swarm = Swarm(**own)
    swarm.enter()
    swarm.fly(8.0)
    return swarm


def pairs(swarm: Swarm, names: str = "abcd") -> list[float]:
    return sorted(distance(swarm.place(a), swarm.place(b)) for a, b in combinations(names, 2))


def middle(swarm: Swarm, names: str = "abcd") -> Vec3:
    return centroid(tuple(map(swarm.place, names)))


def test_they_take_the_places_of_a_square_and_tell_when_they_are_there() -> None:
    swarm = formed()
    assert pairs(swarm) == pytest.approx([1.0] * 4 + [2**0.5] * 2, abs=1e-3)
    assert {name for name, _ in swarm.told("formation_settled")} == set("abcd")


def test_they_never_come_close_on_their_way() -> None:
    swarm = Swarm()
    swarm.enter()
    for _ in range(80):
        swarm.fly(0.1)
        assert pairs(swarm)[0] > 0.7


def test_the_distances_stay_while_a_hand_moves_and_turns_them() -> None:
    swarm = formed(input="stick")
    before = middle(swarm)
    for _ in range(40):
        swarm.fly(0.1, x=0.6, y=-0.3, turn=0.5)
        assert pairs(swarm) == pytest.approx([1.0] * 4 + [2**0.5] * 2, abs=0.02)
    assert distance(before, middle(swarm)) > 0.5


def test_no_place_leaves_the_fence_however_it_is_pushed() -> None:
    swarm = formed(input="stick", speed=1.0)
    swarm.fly(15.0, x=1.0)
    assert max(swarm.place(name)[0] for name in PLACES) == pytest.approx(3.7, abs=0.05)
    assert pairs(swarm)[0] == pytest.approx(1.0, abs=0.02)


def test_it_fails_when_a_member_does_not_come() -> None:
    swarm = Swarm(patience=3.0)
    swarm.enter("abc")
    swarm.fly(3.5)
    failed = swarm.ends["a"]
    assert isinstance(failed, Failed)
    assert failed.reason == "`d` has not come within 3 s"


@pytest.mark.parametrize(
    ("lost", "reason"),
    [
        (lambda swarm: {"silent": "b"}, "silent for"),
        (lambda swarm: swarm.off.update(b=(1.0, 0.0, 0.0)) or {}, "1.00 m from its place"),
    ],
)
def test_the_others_stop_for_one_that_is_lost_and_go_on_with_it(
    lost: Callable[[Swarm], dict[str, Any]], reason: str
) -> None:
    swarm = formed(input="stick")
    swarm.fly(2.0, x=0.6)
    assert swarm.speed() > 0.25
    trouble = lost(swarm)
    swarm.flown.pop("b") if trouble else None
    swarm.fly(2.0, x=0.6, **trouble)
    others = {name for name, _ in swarm.told("neighbour_lost")}
    assert others >= {"a", "c", "d"}
    assert all(reason in fields["reason"] for _, fields in swarm.told("neighbour_lost"))
    assert all(distance(swarm.setpoints[n].velocity or ZERO, ZERO) < 0.01 for n in "acd")
    assert {swarm.flown[n].waits_for for n in "acd"} == {"`b` to recover"}


def test_it_goes_on_once_a_jump_is_over() -> None:
    swarm = formed(input="stick")
    swarm.off["b"] = (1.0, 0.0, 0.0)
    swarm.fly(1.0, x=0.5)
    swarm.off["b"] = ZERO
    swarm.fly(3.0, x=0.5)
    assert swarm.speed() > 0.2
    assert {fields["neighbour"] for _, fields in swarm.told("neighbour_recovered")} == {"b"}
    assert swarm.flown["a"].waits_for is None


def test_one_leaves_and_comes_back_into_the_place_that_is_free() -> None:
    swarm = formed()
    del swarm.flown["d"]
    swarm.fly(0.5)
    assert {(n, f["neighbour"]) for n, f in swarm.told("neighbour_left")} == {
        ("a", "d"), ("b", "d"), ("c", "d"),
    }  # fmt: skip
    assert len(swarm.told("formation_settled")) == 4
    swarm.setpoints["d"] = at_rest((2.0, -2.0, 1.2))
    swarm.enter("d")
    swarm.fly(10.0)
    assert len(swarm.told("formation_settled")) == 8
    assert pairs(swarm) == pytest.approx([1.0] * 4 + [2**0.5] * 2, abs=5e-3)


def test_going_over_to_the_same_formation_makes_no_step() -> None:
    swarm = formed(input="stick")
    swarm.fly(2.0, x=0.8)
    before = {name: swarm.setpoints[name] for name in PLACES}
    swarm.enter()
    swarm.fly(DT)
    for name in PLACES:
        change = distance(swarm.setpoints[name].velocity or ZERO, before[name].velocity or ZERO)
        assert change < 0.05
    assert not swarm.told("neighbour_left")


def test_two_runs_are_the_same() -> None:
    def last_places() -> list[Vec3]:
        swarm = formed(input="stick")
        swarm.fly(1.0, y=0.2)
        return [swarm.place(name) for name in PLACES]

    assert last_places() == last_places()


def test_along_a_path_it_is_done_at_the_last_corner() -> None:
    swarm = Swarm(path=((0.5, 0.0, 1.2), (0.5, 0.5, 1.2)))
    swarm.enter()
    swarm.fly(20.0)
    assert all(isinstance(swarm.ends[name], Done) for name in PLACES)
    assert middle(swarm) == pytest.approx((0.5, 0.5, 1.2), abs=0.04)


def test_one_that_comes_back_goes_round_those_who_stand_in_its_way() -> None:
    points = ((1.2, 0.0, 0.0), (0.0, 0.0, 0.0), (-1.2, 0.0, 0.0), (0.0, 1.2, 0.0))
    swarm = formed(points=points, center=(0.0, 0.0, 1.0), turned=0.0)
    [back] = [n for n in PLACES if distance(swarm.place(n), (1.2, 0.0, 1.0)) < 0.05]
    del swarm.flown[back]
    swarm.setpoints[back] = at_rest((-2.4, 0.05, 1.0))
    swarm.fly(1.0)
    swarm.enter(back)
    apart = []
    for _ in range(180):
        swarm.fly(0.1)
        apart.append(pairs(swarm)[0])
    assert min(apart) > 0.48
    assert distance(swarm.place(back), (1.2, 0.0, 1.0)) < 0.01


@pytest.mark.thorough
@pytest.mark.parametrize("path_at_once", [True, False])
def test_one_that_comes_back_goes_on_along_the_path_where_the_others_are(
    path_at_once: bool,
) -> None:
    swarm = formed(path=((0.5, 0.0, 1.2), (0.5, 2.0, 1.2), (-1.0, 2.0, 1.2)))
    del swarm.flown["d"]
    swarm.setpoints["d"] = at_rest((2.0, -2.0, 1.2))
    swarm.fly(2.0)
    assert middle(swarm, "abc")[1] > 0.5
    still = {} if path_at_once else {"path": None}
    swarm.enter("d", **still)
    if still:
        swarm.fly(4.0)
        swarm.enter("d")
    swarm.fly(25.0)
    assert all(isinstance(swarm.ends[name], Done) for name in PLACES)
    assert middle(swarm) == pytest.approx((-1.0, 2.0, 1.2), abs=0.04)


def test_behind_a_leader_three_keep_their_triangle_around_it() -> None:
    swarm = Swarm(members="trio", shape="triangle", side=2.0, leader="d", offset=(0.0, 0.0, 0.5))
    swarm.enter("abc")
    swarm.fly(12.0)
    assert middle(swarm, "abc") == pytest.approx(add(PLACES["d"], (0.0, 0.0, 0.5)), abs=0.02)
    assert pairs(swarm, "abc") == pytest.approx([2.0] * 3, abs=5e-3)


def test_a_follower_keeps_its_offset_and_fails_when_the_other_stays_silent() -> None:
    swarm = Swarm()
    params = FollowParams(vehicle="b", offset=(0.0, 1.0, 0.0), frame="world", delay=0.02)
    swarm.flown["a"] = Follow(params, swarm.entry("a", CENTRED))
    swarm.fly(6.0)
    assert swarm.place("a") == pytest.approx(add(PLACES["b"], (0.0, 1.0, 0.0)), abs=1e-3)
    swarm.fly(3.0, silent="b")
    failed = swarm.ends["a"]
    assert isinstance(failed, Failed)
    assert "`b` is silent for" in failed.reason


def test_whom_nobody_hears_does_not_run_ahead_into_the_others() -> None:
    swarm = formed(input="stick")
    for _ in range(10):
        swarm.fly(1.0, silent="b", x=1.0, turn=0.5)
        assert pairs(swarm)[0] > 0.7


def test_who_comes_back_makes_for_the_corner_that_the_others_make_for() -> None:
    swarm = formed(path=((1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)))
    del swarm.flown["d"]
    swarm.setpoints["d"] = at_rest(swarm.place("d"))
    swarm.fly(1.0)
    assert {swarm.flown[name].says.corner for name in "abc"} == {1}
    swarm.enter("d")
    swarm.fly(15.0)
    assert all(isinstance(swarm.ends[name], Done) for name in PLACES)


def test_that_it_is_settled_is_told_once_however_long_one_is_silent_on_its_path() -> None:
    swarm = Swarm(path=((3.0, 0.0, 1.2), (-3.0, 0.0, 1.2)))
    swarm.enter()
    swarm.fly(6.0)
    assert len(swarm.told("formation_settled")) == 4
    swarm.fly(10.0, silent="b")
    assert len(swarm.told("formation_settled")) == 4
    swarm.fly(3.0)
    assert sorted(name for name, _ in swarm.told("formation_settled")[4:]) == ["a", "c", "d"]


def test_one_that_is_held_up_as_far_away_as_stops_the_others_is_lost_once() -> None:
    swarm = formed(input="stick")
    for away in (0.51, 0.49, 0.505, 0.49) * 3:
        swarm.off["b"] = (away, 0.0, 0.0)
        swarm.fly(0.5)
        assert swarm.flown["a"].waits_for == "`b` to recover"
    swarm.off["b"] = ZERO
    swarm.fly(2.0)
    assert {name for name, _ in swarm.told("neighbour_lost")} == set("acd")
    assert len(swarm.told("neighbour_lost")) == len(swarm.told("neighbour_recovered")) == 3
