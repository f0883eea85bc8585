"""A flight with fifty commands, legal and not, from two people: each is answered as the situation
said just before; and flown again from its record it is the same flight."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import pytest
from commanders import Asked, People
from plans import after, on, part, state, then, vehicle
from short_flights import down, path, up

from kybflow.core.signals import Event
from kybflow.dsl.expressions import GroupInState
from kybflow.dsl.plan import (
    CallbackPlan,
    Emit,
    FlowPlan,
    LogText,
    PhasePlan,
    Request,
    TransitionPlan,
    VehiclePlan,
)
from kybflow.recording.earlier_run import read_earlier_run
from kybflow.runtime.commanding.situation import Situation

COUNT, FROM, EVERY = 50, 0.5, 0.2
STATES = ("up", "still", "side", "down", "hover", "brake", "landed", "auto_land", "fault", "sid")
COMMANDS = (
    *(f"switch {v} {state}" for v in "ab" for state in STATES),
    *(f"switch {v} side position=[{x}, 0, 1] speed=50 cm/s" for v in "ab" for x in (-1, 0.5, 9)),
    *(f"phase team {phase}" for phase in ("launch", "dance", "dnce")),
    *("pause", "resume", "pause a", "resume a", "pause b", "resume b", "reset", "reset a"),
    *("emit operator.go", "emit ready", "emit landed", "emit a.landed", "emit operator.og"),
    *(f"{word} a.processors.{name}" for word in ("enable", "disable") for name in ("fence", "x")),
    *(f"set b.processors.fence.margin {value}" for value in ("21 cm", "40 cm", "1 cm", "2 kg")),
    *("release", "leave"),
)


def flier(name: str, side: float) -> VehiclePlan:
    aside = part("behaviors", "fly_to", position=(side, 0.8, 0.8))
    still = state("still", part("behaviors", "hover"), after(60.0, "down"))
    states = [still, up("still"), state("side", aside, then("still")), down()]
    return vehicle(name, states, start=(side, 0.0, 0.0), begin="landed")


def phase(name: str, asked: str | None, way: TransitionPlan) -> PhasePlan:
    run = {} if asked is None else {"a": Request(asked), "b": Request(asked)}
    return PhasePlan(name=name, run=run, transitions=(way,))


def mission() -> dict[str, Any]:
    both_up = GroupInState("all", "both", ("a", "b"), "still")
    phases = (
        phase("launch", "up", TransitionPlan(target="wait", when=both_up)),
        phase("wait", None, on("operator.go", "dance")),
        phase("dance", "side", on("ready", "wait")),
    )
    team = FlowPlan(
        name="team", begin="launch", vehicles=("a", "b"), phases={p.name: p for p in phases}
    )
    ready = CallbackPlan(
        event="operator.go", vehicles=("",), actions=(Emit("ready"), LogText("go"))
    )
    return {"flows": (team,), "callbacks": (ready,)}


def drawn(seed: int) -> list[Asked]:
    """Commands at random, the last of which lands and ends the run."""
    draw = random.Random(seed)
    end = FROM + COUNT * EVERY
    given = [
        Asked(
            draw.uniform(FROM, end),
            draw.choice(COMMANDS),
            draw.choice(("anna", "anna", "ben")),
            draw.random() < 0.2,
        )
        for _ in range(COUNT - 1)
    ]
    return [*given, Asked(end, "stop", "ben")]


def foreseen(words: str, saw: Situation) -> str | None:
    """Why a command would be refused, as the situation has it; empty where it doesn't tell that."""
    command, *names = words.split()
    vehicles = {v.name: v for v in saw.vehicles}
    if command == "switch" and len(names) == 2:
        return vehicles[names[0]].enter.get(names[1], "")
    if command in ("pause", "resume", "reset") and names:
        why: str | None = getattr(vehicles[names[0]], command)
        return why
    if command == "phase":
        return saw.flows[0].enter.get(names[1], "")
    return ""


def check_foreseen(people: People) -> None:
    """Each command that was the only one in its tick was answered as the situation said."""
    times = Counter(saw.time for saw in people.saw)
    for (words, accepted, reason), saw in zip(people.answers, people.saw, strict=True):
        why = foreseen(words, saw)
        if times[saw.time] > 1 or "commands this run" in reason or why == "":
            continue
        assert (why is None, why or "") == (accepted, reason)


def transitions(told: list[Event]) -> list[Event]:
    return [event for event in told if event.name not in ("run_ended", "observer_failed")]


@pytest.mark.parametrize(
    "seed",
    [
        *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(2)),
        *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 12)),
    ],
)
def test_a_flight_with_fifty_commands_is_the_same_flown_again(run, seed: int) -> None:
    people = People(*drawn(seed))
    vehicles = (flier("a", -0.8), flier("b", 0.8))
    flown, told = run(
        *vehicles, seed=seed, servers=(people.serve,), observers=(people.look,), **mission()
    )
    check_foreseen(people)
    assert {accepted for _, accepted, _ in people.answers} == {True, False}
    assert len(path(told, "a")) > 3
    earlier = read_earlier_run(flown.folder)
    assert 30 < len(earlier.commands) <= COUNT
    again, retold = run(*vehicles, seed=earlier.seed, again=earlier.commands, **mission())
    assert transitions(retold) == transitions(told)
    assert again.summary["outcome"] == flown.summary["outcome"]
    assert again.never_given == ()
