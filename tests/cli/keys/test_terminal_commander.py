"""A person at the run's own terminal commands it by keys."""

from __future__ import annotations

from io import StringIO

import pytest
from commanders import Asked, People
from fingers import Person
from plans import part, state, vehicle
from rich.console import Console
from short_flights import down, hold, named, path, up

from kybflow.cli.printing.live import LivePanel
from kybflow.core.signals import NS
from kybflow.dsl.plan import TransitionPlan


def waiting():
    go = TransitionPlan(target="up", event="operator.go")
    idle = state("idle", part("behaviors", "wait_on_ground"), go)
    return vehicle("a", [idle, up("hold"), hold(60.0, "down"), down()])


class Script:
    """An observer that does what is due: (seconds, what)."""

    def __init__(self, *deeds) -> None:
        self._deeds = list(deeds)

    def __call__(self, engine) -> None:
        while self._deeds and engine.clock.now >= self._deeds[0][0] * NS:
            self._deeds.pop(0)[1](engine)


def events_of(run, person: Person, *deeds, others=()):
    """The flight of one vehicle that waits for `operator.go`; what it told."""
    people = People(*others)
    _, told = run(
        waiting(),
        observers=(people.look, Script(*deeds)),
        servers=(people.serve, person.commander.serve),
    )
    return told


def given(told) -> list[tuple[str, str]]:
    return [(e.fields["by"], e.fields["command"]) for e in named(told, "command_given")]


def test_a_mission_that_waits_is_let_go_and_landed(run) -> None:
    person, saw = Person(), []

    def sees(engine):
        person.see(engine)
        saw.append(person.says())

    told = events_of(
        run,
        person,
        (1.0, lambda engine: person.press(engine, "operator.go")),
        (1.1, sees),
        (1.2, lambda engine: person.press(engine, "enter")),
        (1.3, sees),
        (6.0, lambda engine: person.press(engine, "land")),
    )
    assert saw == ["emit operator.go? Enter gives it, Esc cancels", "emit operator.go: accepted"]
    assert given(told) == [("terminal", "emit operator.go"), ("terminal", "land")]
    assert path(told, "a") == ["idle", "up", "hold", "auto_land", "landed"]
    assert not person.keys.is_open


def test_only_pause_and_land_act_without_enter(run) -> None:
    person = Person()

    def slips(engine):
        for name in ("a down", "a hover", "stop"):
            person.press(engine, name)

    def chooses_and_leaves(engine):
        person.press(engine, "stop")
        person.keys.typed = b"\x1b"
        person.commander.read_keys()
        person.commander.read_keys()
        assert person.says() == ""
        person.press(engine, "enter")
        person.press(engine, "stop")
        person.time += 11.0
        assert person.says() == ""
        person.press(engine, "enter")

    told = events_of(
        run,
        person,
        (0.5, lambda engine: person.press(engine, "operator.go", "enter")),
        (5.0, slips),
        (6.0, lambda engine: person.press(engine, "pause")),
        (7.0, chooses_and_leaves),
        (8.0, lambda engine: person.press(engine, "resume", "enter")),
        (9.0, lambda engine: person.press(engine, "stop", "enter")),
    )
    commands = [command for _, command in given(told)]
    assert commands == ["emit operator.go", "pause", "resume", "stop"]
    assert path(told, "a") == ["idle", "up", "hold", "auto_land", "landed"]


@pytest.mark.thorough
def test_a_key_that_means_nothing_is_told(run) -> None:
    person = Person()

    def presses(engine):
        person.see(engine)
        person.keys.typed = b"Z"
        person.commander.read_keys()
        assert person.says() == "`Z` has no command now"

    stop = (1.0, lambda engine: person.press(engine, "stop", "enter"))
    assert given(events_of(run, person, (0.5, presses), stop)) == [("terminal", "stop")]


@pytest.mark.thorough
def test_the_lease_of_another_is_taken_as_the_choice_says(run) -> None:
    person, saw = Person(), []

    def takes(engine):
        person.press(engine, "operator.go")
        saw.append(person.says())
        person.press(engine, "enter")

    told = events_of(
        run,
        person,
        (1.0, takes),
        (3.0, lambda engine: person.press(engine, "land")),
        others=(Asked(0.5, "resume", "anna"), Asked(2.0, "switch a down", "anna")),
    )
    assert saw == ["emit operator.go? Enter gives it and takes the lease from anna, Esc cancels"]
    [taken] = named(told, "lease_taken")
    assert taken.fields == {"by": "terminal", "previous": "anna"}
    refused = [e.fields["reason"] for e in named(told, "command_given") if "reason" in e.fields]
    assert refused[-1].startswith("`terminal` commands this run")


@pytest.mark.thorough
def test_a_refusal_is_shown(run) -> None:
    person, saw = Person(), []

    def confirms(engine):
        engine.vehicles[0].requests.retire("a test ends it")
        person.press(engine, "enter")

    told = events_of(
        run,
        person,
        (0.5, lambda engine: person.press(engine, "operator.go", "enter")),
        (5.0, lambda engine: person.press(engine, "a hover")),
        (5.0, confirms),
        (5.2, lambda engine: saw.append(person.says())),
    )
    assert saw == ["switch a hover: refused: the run ends: a test ends it"]
    assert named(told, "switch_refused")


SIZES = ((80, 24), (120, 40), (40, 12))


def test_the_table_shows_the_keys_and_the_answer(run) -> None:
    person, shown = Person(), {size: [] for size in SIZES}

    def sees(engine):
        for width, height in SIZES:
            file = StringIO()
            console = Console(file=file, width=width, height=height)
            console.print(LivePanel(console, person.commander).drawing(engine, 1.0))
            shown[width, height].append(file.getvalue())

    events_of(
        run,
        person,
        (0.1, sees),
        (1.0, lambda engine: person.press(engine, "operator.go", "enter")),
        (4.0, sees),
        (4.5, lambda engine: person.press(engine, "pause")),
        (4.6, sees),
        (5.0, lambda engine: person.press(engine, "stop", "enter")),
    )
    for (width, height), (waits, flies, paused) in shown.items():
        assert all(len(line) <= width for line in (waits + flies).splitlines())
        assert all(len(one.splitlines()) <= height for one in (waits, flies, paused))
        assert "p  pause    l  land" in flies
        assert "emit operator.go: accepted" in flies
        if width >= 80:
            assert "events     1  operator.go\n" in waits
            assert ", paused │" in paused
            assert "\na          5  down    7  auto_home\n" in flies
