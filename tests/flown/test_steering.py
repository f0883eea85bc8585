"""Steered flights: a lost input, hand-overs, what is pushed against, and the same flight again."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import cos, isnan, pi, sin
from typing import Any

import pytest
from plans import FENCE, failed, on, part, state, vehicle
from short_flights import down, named, path, up

from kybflow.core.geometry import ZERO, distance, norm, scale, sub
from kybflow.core.signals import NS, InputReading, Setpoint, SetpointKind, Tick, Time
from kybflow.dsl.plan import InputPlan, PartPlan, VehiclePlan
from kybflow.parts import AXES, Input, InputLink, Processor
from kybflow.parts.input import SticksOf
from kybflow.recording.earlier_run import read_earlier_run
from kybflow.runtime.engine import Engine
from kybflow.world.shapes import Box, Cylinder, Shape, Sphere

SILENT, STUCK = 0.3, 1.0
CENTRED = dict.fromkeys(AXES, 0.0)
Say = Callable[[Time], InputReading | str]
"""What a device says at a time, or why it says nothing."""


@dataclass(frozen=True)
class HandParams:
    say: Say


class Hand(Input[HandParams]):
    """A person in a test, who is as fast as the simulation."""

    @classmethod
    def real_time(cls, params: HandParams) -> bool:
        return False

    @classmethod
    def buttons(cls, params: HandParams) -> tuple[str, ...]:
        return ("take", "give", "end")

    @classmethod
    def open(cls, params: HandParams, sticks_of: SticksOf) -> InputLink:
        return HandLink(params.say)


class HandLink(InputLink):
    def __init__(self, say: Say) -> None:
        self._say, self._said = say, InputReading(0, CENTRED)
        self._trouble: str | None = None

    def read(self, now: Time) -> InputReading | None:
        said = self._say(now)
        self._trouble = said if isinstance(said, str) else None
        return None if isinstance(said, str) else said

    def trouble(self) -> str | None:
        return self._trouble

    def close(self) -> None: ...


class Tap(Processor[Any]):
    """Keeps every setpoint that was asked for, with its time."""

    accepts = {SetpointKind.POSITION: SetpointKind.POSITION}  # noqa: RUF012
    safety = True
    kept: list[tuple[Time, Setpoint]] = []  # noqa: RUF012

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        self.kept.append((tick.now, setpoint))
        return setpoint


@pytest.fixture
def kept() -> list[tuple[Time, Setpoint]]:
    Tap.kept = []
    return Tap.kept


def hand(say: Say, stuck: float | None = STUCK) -> dict[str, Any]:
    own = PartPlan("hand", Hand, HandParams(say), "inputs.stick")
    names = {name: name for name in ("take", "give", "end")}
    stick = InputPlan(
        name="stick", part=own, button_names=names, silent_after=SILENT, stuck_after=stuck
    )
    return {"inputs": (stick,)}


def flier(**own: Any) -> VehiclePlan:
    steered = part("behaviors", "steer", input="stick", **own)
    round_ = part("behaviors", "circle", center=(0.0, 0.0, 1.0), radius=0.5, speed=0.4)
    end = on("stick.end", "down")
    states = [
        up("hand", 1.0),
        state("hand", steered, on("stick.give", "auto"), end, failed("down")),
        state("auto", round_, on("stick.take", "hand"), end),
        down(),
    ]
    tap = PartPlan("tap", Tap, None, "processors.tap")
    return vehicle("a", states, processors=(part("processors", "fence"), tap))


def said(x: float, y: float = 0.0, z: float = 0.0, *held: str) -> InputReading:
    return InputReading(0, dict(zip(AXES, (x, y, z, 0.0), strict=True)), frozenset(held))


def breaking(how: str, at: Time) -> Say:
    """Full forward from 6 s on, and the device breaks at `at`."""

    def say(now: Time) -> InputReading | str:
        late = now > at
        if how == "unplugged" and late:
            return "unplugged"
        x = 0.0 if now < 6 * NS else float("nan") if how == "nan" and late else 0.9
        if how != "stuck" or not late:  # a stick is never quite still
            x -= 1e-4 * (now // 4_000_000 % 7)
        heard = at if how == "silent" and late else now
        return said(x if isnan(x) else max(x, 0.0))._replace(heard=heard)

    return say


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("how", "bound"), [("unplugged", 0.0), ("nan", 0.0), ("silent", SILENT), ("stuck", STUCK)]
)
def test_a_lost_input_brakes_in_time_and_takes_the_way_that_the_mission_says(
    run, kept: list[tuple[Time, Setpoint]], how: str, bound: float
) -> None:
    at = 8 * NS
    _, told = run(flier(speed=0.5, patience=1.5), **hand(breaking(how, at)))
    [lost] = named(told, "input_lost")
    assert lost.fields["input"] == "stick"
    assert lost.time <= at + round((bound + 0.2) * NS)
    fast = {now: norm(s.velocity or ZERO) for now, s in kept}
    before = fast[max(now for now in fast if now <= lost.time - NS // 250)]
    after = fast[min(now for now in fast if now >= at + round((bound + 0.2) * NS))]
    assert before > 0.4
    assert after < before - 0.1  # it has braked by then, at 1 m/s^2
    [gave_up] = named(told, "behavior_failed")
    assert pytest.approx(lost.time + 1.5 * NS, abs=0.01 * NS) == gave_up.time
    assert path(told, "a") == ["up", "hand", "down", "landed"]


@pytest.mark.thorough
def test_no_button_takes_over_while_the_sticks_are_off_their_centres(run) -> None:
    def say(now: Time) -> InputReading:
        pressed = ("give",) if now < 7 * NS else ("take",) if now % NS < NS // 2 else ()
        held = ("end",) if now > 12 * NS else pressed if now > 6 * NS else ()
        return said(0.4 if 6.5 * NS < now < 9 * NS else 0.0, 0.0, 0.0, *held)._replace(heard=now)

    _, told = run(flier(), **hand(say, None))
    assert path(told, "a") == ["up", "hand", "auto", "hand", "down", "landed"]
    refused = named(told, "switch_refused")
    assert [round(e.time / NS, 1) for e in refused] == [7.0, 8.0]
    assert refused[0].fields["reason"] == "the sticks of `stick` are off their centres"
    back = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "hand"][1]
    assert pytest.approx(9.0, abs=0.02) == back.time / NS


def moments(seed: int) -> Say:
    """Give and take at random moments, steer at random between; centred when it takes."""
    draw = random.Random(seed)
    plan: list[tuple[float, InputReading]] = []
    time = 6.0
    for _ in range(25):
        for _ in range(draw.randint(1, 3)):
            way = draw.uniform(-pi, pi)
            plan.append((time, said(cos(way), sin(way), draw.uniform(-1, 1))))
            time += draw.uniform(0.1, 0.8)
        steered = plan[-1][1]
        plan.append((time, steered._replace(held=frozenset({"give"}))))
        plan.append((time + 0.1, said(0.0)))
        time += draw.uniform(0.2, 1.5)
        plan.append((time, said(0.0, 0.0, 0.0, "take")))
        time += 0.1
    plan.append((time, said(0.0, 0.0, 0.0, "end")))

    def say(now: Time) -> InputReading:
        spoken = [reading for at, reading in plan if at * NS <= now]
        return (spoken[-1] if spoken else said(0.0))._replace(heard=now)

    return say


@pytest.mark.thorough
@pytest.mark.parametrize("by", ["velocity", pytest.param("signals", marks=pytest.mark.slow)])
def test_hand_overs_at_a_hundred_random_moments_have_no_step(
    run, kept: list[tuple[Time, Setpoint]], by: str
) -> None:
    _, told = run(flier(by=by, speed=0.7), time_limit=200.0, **hand(moments(3)))

    assert len([e for e in path(told, "a") if e in ("hand", "auto")]) == 51
    steps = []
    for (_, before), (now, after) in pairwise(kept):
        foreseen = scale(before.velocity or ZERO, 1 / 250)
        moved = sub(after.position or ZERO, before.position or ZERO)
        steps.append((distance(moved, foreseen), now))
        assert norm(sub(after.velocity or ZERO, before.velocity or ZERO)) < 0.05
    assert max(steps)[0] < 0.01


SOLIDS: dict[str, Shape] = {
    "pillar": Cylinder((0.9, 0.2, 0.0), 0.15, 2.5),
    "crate": Box((-1.3, 0.5, 0.0), (-0.7, 1.1, 1.3)),
    "ball": Sphere((0.0, -1.1, 1.2), 0.2),
}


def pushing(seed: int) -> Say:
    """Somebody pushes at full deflection, mostly at what is in the way, for a minute."""
    draw = random.Random(seed)
    plan, time = [(0.0, said(0.0))], 6.0
    while time < 66.0:
        way = draw.uniform(-pi, pi)
        plan.append((time, said(cos(way), sin(way), draw.choice((-1.0, 0.0, 0.0, 1.0)))))
        time += draw.choice((0.5, 1.5, 4.0))
    plan.append((66.0, said(0.0, 0.0, 0.0, "end")))
    return lambda now: [r for at, r in plan if at * NS <= now][-1]._replace(heard=now)


@pytest.mark.parametrize(
    "seed",
    [pytest.param(s, marks=pytest.mark.slow if s > 1 else pytest.mark.thorough) for s in range(50)],
)
def test_pushed_into_fence_and_obstacles_it_stays_inside_and_touches_nothing(
    run, seed: int
) -> None:
    closest = dict.fromkeys(SOLIDS, 9.0)
    walls_and_ceiling, outside = FENCE._replace(low=(*FENCE.low[:2], -9.0)), [-9.0]

    def look(engine: Engine) -> None:
        truth = engine.vehicles[0].truth
        if truth is not None and engine.vehicles[0].state == "hand":
            outside.append(walls_and_ceiling.outside_by(truth.position))
            for name, shape in SOLIDS.items():
                closest[name] = min(closest[name], shape.distance(truth.position))

    steered = flier(by=("velocity", "tilt", "signals")[seed % 3], speed=0.9, acceleration=1.5)
    pushed = hand(pushing(seed), None)
    flown, told = run(
        steered, seed=seed, obstacles=SOLIDS, observers=(look,), time_limit=120.0, **pushed
    )
    assert flown.summary["outcome"] == "succeeded", flown.summary["reason"]
    assert path(told, "a") == ["up", "hand", "down", "landed"]
    assert named(told, "collided") + named(told, "failsafe_started") == []
    assert max(outside) < -0.2
    assert min(closest.values()) > 0.095 + 0.2, closest


@pytest.mark.thorough
def test_a_steered_flight_is_the_same_flown_again_from_what_it_recorded(run) -> None:
    draw = random.Random(1)

    def noisy(now: Time) -> InputReading | str:
        if 9 * NS < now < 9.5 * NS:
            return "unplugged"
        x = 0.0 if now < 6 * NS or now % NS < NS // 5 else draw.uniform(-1.0, 1.0)
        held = ("end",) if now > 12 * NS else ()
        return said(x, -x, 0.0, *held)._replace(heard=now)

    flown, told = run(flier(patience=3.0), **hand(noisy))
    earlier = read_earlier_run(flown.folder)
    again, retold = run(flier(patience=3.0), said=earlier.inputs, **hand(lambda _: "never asked"))
    assert told == retold
    assert (flown.folder / "log.mcap").read_bytes() == (again.folder / "log.mcap").read_bytes()
