"""The keys of a terminal: decoded, assigned to commands, and pressed by whoever commands a run."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import pytest
from commanders import Asked, People
from fingers import Person
from hypothesis import given
from hypothesis import strategies as st
from plans import part, state, vehicle
from rich.console import Console
from short_flights import down, hold, named, path, up

from kybflow.cli.keys import ENTER, ESCAPE, FIXED, KEYS, OfferedKeys, PressedKeys
from kybflow.cli.printing.live import LivePanel
from kybflow.core.signals import NS
from kybflow.dsl.plan import Emit, Stop, Switch, TransitionPlan
from kybflow.runtime.commanding.orders import LandOrder, PauseOrder, ResetOrder, ResumeOrder
from kybflow.runtime.commanding.situation import FlowSituation, Situation, VehicleSituation


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


def commanded(told) -> list[tuple[str, str]]:
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
    assert commanded(told) == [("terminal", "emit operator.go"), ("terminal", "land")]
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
    commands = [command for _, command in commanded(told)]
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
    assert commanded(events_of(run, person, (0.5, presses), stop)) == [("terminal", "stop")]


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
    assert saw == ["switch a hover: refused: a test ends it"]
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


NO = "not now"


def in_state(name: str, state: str, enter: dict[str, str | None], **facts) -> VehicleSituation:
    legal = {"pause": None, "resume": NO, "reset": NO, "land": None, "latched": None}
    nothing = dict.fromkeys(
        ("braking", "override", "retired", "driver", "battery", "estimate", "setpoint")
    )
    seen = {"behavior": "hover", "flight": "air", "elapsed": 1.0, "holders": (), "waits_for": ()}
    return VehicleSituation(
        name=name, state=state, enter=enter, **{**seen, **legal, **nothing, **facts}
    )


def situation(*vehicles, flows=(), emit=None) -> Situation:
    return Situation("eight", 1.5, True, None, vehicles, tuple(flows), emit or {})


def offered(keys: OfferedKeys, seen: Situation, now: float = 0.0) -> dict[str, str]:
    return {f"{o.group} {o.name}".strip(): o.key for o in keys.assign(seen, now)}


HOLD = in_state("a", "hold", {"hold": None, "go": None, "down": NO, "landed": None, "hover": None})


def test_what_is_legal_is_offered_with_its_key() -> None:
    team = FlowSituation("team", "wait", 1.0, ("a",), (), {"wait": None, "dance": None})
    seen = situation(HOLD, flows=(team,), emit={"operator.go": True, "ready": False})
    assert offered(OfferedKeys(), seen) == {
        "pause": "p",
        "land": "l",
        "stop": "s",
        "events operator.go": "1",
        "a go": "4",
        "a hover": "6",
        "team dance": "8",
    }


def test_each_key_gives_its_command() -> None:
    found = OfferedKeys().assign(situation(HOLD, emit={"ready": True}), 0.0)
    switches = [Switch("a", "go"), Switch("a", "hover")]
    orders = [offer.order for offer in found]
    assert orders == [PauseOrder(), LandOrder(), Stop(""), Emit("ready"), *switches]


def test_a_paused_vehicle_can_be_resumed_and_one_in_fault_reset() -> None:
    paused = replace(HOLD, holders=("pause",), resume=None)
    lost = in_state("b", "fault", {}, pause=NO, reset=None, retired="landed")
    found = OfferedKeys().assign(situation(paused, lost), 0.0)
    orders = [offer.order for offer in found[:4]]
    assert orders == [LandOrder(), ResumeOrder(), ResetOrder(), Stop("")]


def test_what_the_mission_waits_for_of_a_fixed_key_is_offered_there() -> None:
    found = offered(OfferedKeys(), situation(HOLD, emit={"operator.resume": True}))
    assert found["resume"] == "r"
    assert "events operator.resume" not in found


def test_before_the_flight_it_can_only_be_stopped() -> None:
    early = in_state("a", "", {"go": NO}, pause=NO, land=NO)
    assert offered(OfferedKeys(), situation(early)) == {"stop": "s"}


def test_a_chain_is_offered_by_its_name() -> None:
    chain = in_state("a", "hold", {"hold": None, "tour.there": None, "tour.back": NO})
    assert "a tour" in offered(OfferedKeys(), situation(chain))


def test_a_key_keeps_its_meaning() -> None:
    keys = OfferedKeys()
    first = offered(keys, situation(HOLD))
    gone = replace(HOLD, enter=dict.fromkeys(HOLD.enter, NO))
    assert offered(keys, situation(gone, emit={"ready": True}), 100.0)["events ready"] == "5"
    assert offered(keys, situation(HOLD), 101.0).items() >= first.items()


def test_where_the_keys_are_used_up_one_changes_only_after_a_rest() -> None:
    states = dict.fromkeys((f"s{number}" for number in range(len(KEYS))), NO)
    many = in_state("a", "up", {**states, "s0": None, "s1": None, "up": None})
    last = in_state("b", "up", {"go": None})
    keys = OfferedKeys(rest=10.0)
    begun = offered(keys, situation(many, last), 0.0)
    assert begun["a s0"] == KEYS[0]
    assert begun["b go"] == KEYS[2], "no vehicle could enter s2 so far"
    full = replace(many, enter=dict.fromkeys(many.enter))
    assert offered(keys, situation(full, last), 1.0)["a s2"] == ""
    less = replace(full, enter={**full.enter, "s0": NO})
    assert offered(keys, situation(less, last), 11.0)["a s2"] == ""
    assert offered(keys, situation(less, last), 11.5)["a s2"] == KEYS[0]
    assert offered(keys, situation(less, last), 11.5)["b go"] == KEYS[2]


def test_no_key_is_of_two() -> None:
    assert len({*KEYS, *FIXED}) == len(KEYS) + len(FIXED)


UP, DELETE, F1, ALT_L = b"\x1b[A", b"\x1b[3~", b"\x1bOP", b"\x1bl"
PASTED = b"\x1b[200~land\r\x1b[201~"


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"l", ["l"]),
        (b"1\r", ["1", ENTER]),
        (b"\n", [ENTER]),
        ("ö".encode(), ["ö"]),
        (UP + DELETE + F1 + b"p", ["p"]),
        (ALT_L, []),
        (b"\x13\x7f\t", []),
        (b"\xff", []),
        (PASTED + b"p", ["p"]),
        (b"\x1b\x1b[A", [ESCAPE]),
        (b"\x1b", []),
    ],
)
def test_what_is_a_key(data: bytes, keys: list[str]) -> None:
    assert PressedKeys().read(data) == keys


def test_an_escape_is_a_key_when_nothing_follows() -> None:
    pressed = PressedKeys()
    assert pressed.read(b"p\x1b") == ["p"]
    assert pressed.read(b"") == [ESCAPE]
    assert pressed.read(b"") == []


def test_half_a_sequence_that_stays_half_is_forgotten() -> None:
    pressed = PressedKeys()
    assert pressed.read(b"\x1b[") == []
    assert pressed.read(b"") == []
    assert pressed.read(b"A") == ["A"]


@given(st.lists(st.sampled_from([b"l", b"\r", UP, DELETE, F1, PASTED, b"\x1b[200~x"])), st.data())
def test_it_is_the_same_however_the_bytes_arrive(pieces: list[bytes], data: st.DataObject) -> None:
    whole = b"".join(pieces)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(whole)), max_size=6)))
    pressed = PressedKeys()
    parts = [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    found = [key for part in parts if part for key in pressed.read(part)]
    assert found == PressedKeys().read(whole)
