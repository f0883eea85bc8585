"""Inputs are judged by one mechanism: unplugged, silent, stuck, no number; told once, and back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from kybflow.core.errors import DriverError
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Event, InputReading, Time
from kybflow.dsl.plan import InputPlan, PartPlan
from kybflow.inputs.script import Script
from kybflow.parts.input import FeltLink
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.inputs import Inputs

TICK = NS // 250


class Device(FeltLink):
    """Says what a test makes it say; `heard` None is now. felt: what its hand was to feel last."""

    def __init__(self) -> None:
        self.x, self.held = 0.0, frozenset[str]()
        self.heard: Time | None = None
        self.gone: str | None = None
        self.error: Exception | None = None
        self.felt: Vec3 | None = None

    def read(self, now: Time) -> InputReading | None:
        if self.error is not None:
            raise self.error
        return InputReading(now if self.heard is None else self.heard, {"x": self.x}, self.held)

    def trouble(self) -> str | None:
        return self.gone

    def apply_force(self, push: Vec3 | None) -> None:
        self.felt = push

    def close(self) -> None: ...


class Bench:
    """One input, called `stick`, at a device, ticked at 250 Hz."""

    def __init__(self, **more: Any) -> None:
        self.device, self.told, self.now = Device(), list[Event](), 0
        self.noted: list[tuple[Time, InputReading | None, str]] = []
        part = PartPlan("script", Script, None, "inputs.stick")
        facts: dict[str, Any] = {"button_names": {"a": "leave", "r": "hold"}, "silent_after": 0.3}
        plan = InputPlan(name="stick", part=part, **{**facts, **more})
        events = Events((self.told.append,))
        self._events = events
        self.inputs = Inputs(
            (plan,), {"stick": self.device}, events, lambda _, *said: self.noted.append(said)
        )

    def run(self, seconds: float, *, flying: bool = True) -> None:
        for _ in range(round(seconds * 250)):
            self._events.turn(self.now)
            self.inputs.step(self.now, flying=flying)
            self.now += TICK

    @property
    def reading(self) -> InputReading | None:
        return self.inputs.readings["stick"]

    @property
    def names(self) -> list[str]:
        return [event.name for event in self.told]


@pytest.fixture
def bench() -> Bench:
    bench = Bench(stuck_after=2.0)
    bench.run(0.1)
    return bench


def test_what_a_device_says_is_read(bench: Bench) -> None:
    bench.device.x = 0.25
    bench.run(0.004)
    assert bench.reading is not None
    assert bench.reading.axes == {"x": 0.25}
    assert bench.names == []


def test_a_button_is_told_when_it_goes_down_by_the_missions_name(bench: Bench) -> None:
    bench.device.held = frozenset({"a", "unknown"})
    bench.run(0.1)
    bench.device.held = frozenset()
    bench.run(0.1)
    bench.device.held = frozenset({"a"})
    bench.run(0.1)
    assert bench.names == ["stick.leave", "stick.leave"]


def test_what_is_pressed_before_the_flight_is_not_heard_in_it() -> None:
    bench = Bench()
    bench.device.held = frozenset({"a"})
    bench.run(0.1, flying=False)
    bench.run(0.1)
    assert bench.names == []


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ({"gone": "unplugged"}, "unplugged"),
        ({"error": DriverError("the bus is gone")}, "the bus is gone"),
        ({"x": float("nan")}, "its axis `x` is nan"),
        ({"x": 1.5}, "its axis `x` is 1.5"),
    ],
)
def test_what_is_broken_is_lost_in_the_same_tick(
    bench: Bench, broken: dict[str, Any], reason: str
) -> None:
    vars(bench.device).update(broken)
    bench.run(0.004)
    assert bench.reading is None
    [event] = bench.told
    assert (event.name, event.fields["input"]) == ("input_lost", "stick")
    assert event.fields["reason"] == reason
    bench.run(1.0)
    assert bench.names == ["input_lost"]


def test_it_is_back_when_it_has_been_well_for_half_a_second(bench: Bench) -> None:
    bench.device.gone = "unplugged"
    bench.run(0.1)
    bench.device.gone = None
    bench.run(0.4)
    assert bench.reading is None
    bench.run(0.2)
    assert bench.reading is not None
    assert bench.names == ["input_lost", "input_recovered"]


def test_silence_is_told_when_its_bound_has_passed(bench: Bench) -> None:
    bench.device.heard = bench.now
    bench.run(0.3)
    assert bench.names == []
    bench.run(0.012)
    assert bench.reading is None
    [event] = bench.told
    assert pytest.approx(0.3, abs=0.005) == event.fields["value"]
    assert event.fields["bound"] == 0.3


def test_an_axis_is_stuck_only_away_from_its_centre(bench: Bench) -> None:
    bench.run(5.0)
    assert bench.names == []
    bench.device.x = 0.5
    bench.run(2.0)
    assert bench.names == []
    bench.run(0.012)
    assert bench.names == ["input_lost"]
    bench.device.x = 0.4
    bench.run(0.6)
    assert bench.names == ["input_lost", "input_recovered"]


def test_a_button_is_heard_of_a_device_with_a_broken_axis(bench: Bench) -> None:
    bench.device.x, bench.device.held = float("nan"), frozenset({"a"})
    bench.run(0.1)
    assert bench.names == ["stick.leave", "input_lost"]


def test_a_button_that_is_held_through_a_silence_is_told_once(bench: Bench) -> None:
    bench.device.held = frozenset({"a"})
    bench.run(0.1)
    bench.device.gone = "unplugged"
    bench.run(0.1)
    bench.device.gone = None
    bench.run(0.1)
    assert bench.names == ["stick.leave", "input_lost"]


def test_the_dead_man_switch_engages() -> None:
    bench = Bench(dead_man="hold")
    bench.run(0.1)
    assert bench.reading is not None
    assert not bench.reading.engaged
    bench.device.held = frozenset({"r"})
    bench.run(0.004)
    assert bench.reading.engaged


def test_only_what_is_new_is_noted(bench: Bench) -> None:
    bench.run(1.0)
    bench.device.x = 0.5
    bench.run(1.0)
    bench.device.gone = "unplugged"
    bench.run(1.0)
    assert [said and said.axes["x"] for _, said, _ in bench.noted] == [0.0, 0.5, None]
    assert [why for *_, why in bench.noted] == ["", "", "unplugged"]


def test_the_preflight_names_what_is_wrong() -> None:
    bench = Bench()
    bench.device.gone = "no controller is plugged in"
    bench.run(0.1, flying=False)
    [(plan, reason)] = bench.inputs.objections()
    assert (plan.name, reason) == ("stick", "no controller is plugged in")
    assert bench.told == []


def test_the_hand_of_a_lost_input_feels_nothing() -> None:
    bench = Bench()
    bench.run(0.1)
    felt = [bench.device.felt]
    bench.device.gone = "unplugged"
    bench.run(0.1)
    felt.append(bench.device.felt)
    bench.device.gone = None
    bench.run(1.0)
    assert [*felt, bench.device.felt] == [ZERO, None, ZERO]


class Steered:
    """A vehicle that `stick` steers; push: what its hand should feel."""

    def __init__(self, push: Vec3 | None) -> None:
        self.push = push

    def pushes(self) -> Iterator[tuple[str, Vec3 | None]]:
        yield "stick", self.push


@pytest.mark.parametrize(
    ("pushes", "felt"),
    [
        ([], ZERO),
        ([(1.0, 0.0, 0.0), (0.0, 0.5, 0.0)], (0.5, 0.25, 0.0)),
        ([(1.0, 0.0, 0.0), None], (1.0, 0.0, 0.0)),
        ([None, None], None),
    ],
)
def test_a_hand_feels_the_mean_of_those_that_it_steers_and_that_are_not_held(
    pushes: list[Vec3 | None], felt: Vec3 | None
) -> None:
    bench = Bench()
    bench.inputs.step(0, [Steered(push) for push in pushes])
    assert bench.device.felt == felt
