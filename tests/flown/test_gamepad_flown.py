"""A gamepad in real time: how long a button takes to be an event and a stick to move the setpoint,
and what happens when it is plugged out."""

from __future__ import annotations

import random
import statistics
import threading
import time
from dataclasses import replace
from typing import Any

import pytest
from plans import failed, on, part, plan, state, vehicle
from short_flights import down, named, path, up

pytest.importorskip("pygame")

from virtual_pad import VirtualPad

from kybflow.api.flight import RunRequest, fly
from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, Event, Setpoint, SetpointKind, Tick
from kybflow.dsl.plan import InputPlan, PartPlan, Plan
from kybflow.parts import Processor

RIGHT_Y, A, B = 3, 0, 1
MOVES, PRESSES = 30, 30
MOST = 0.05 * NS
"""Flight time in which half of them must be through: the clock of a busy machine says nothing."""


class Watch(Processor[Any]):
    """Keeps the ticks at which the setpoint's acceleration changed its sign."""

    accepts = {SetpointKind.POSITION: SetpointKind.POSITION}  # noqa: RUF012
    now = 0
    turned: list[int] = []  # noqa: RUF012
    _before = 0.0

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        Watch.now = tick.now
        pull = (setpoint.acceleration or ZERO)[0]
        if pull * self._before < 0.0 or (pull and not self._before):
            self.turned.append(tick.now)
        self._before = pull or self._before
        return setpoint


def steered_flight() -> Plan:
    pad = replace(part("inputs", "gamepad", dead_zone=0.0, expo=0.0), label="inputs.stick")
    steered = part("behaviors", "steer", input="stick", acceleration=2.0, patience=0.5)
    hand = state("hand", steered, on("stick.b", "down"), failed("down"))
    states = [up("hand", 0.6), hand, down()]
    watch = PartPlan("watch", Watch, None, "processors.watch")
    flier = vehicle("a", states, processors=(part("processors", "fence"), watch))
    stick = InputPlan(name="stick", part=pad, button_names={"a": "a", "b": "b"}, silent_after=0.3)
    return plan(flier, inputs=(stick,))


class Person(threading.Thread):
    """Plugs a gamepad in, waits for the steering, and does what `acts` says."""

    def __init__(self, acts: Any) -> None:
        super().__init__(daemon=True)
        self.told: list[Event] = []
        self.done: list[int] = []
        self._acts, self._steers = acts, threading.Event()

    def hear(self, event: Event) -> None:
        self.told.append(event)
        if event.fields.get("behavior") == "hand":
            self._steers.set()

    def run(self) -> None:
        while not any(thread.name == "SDL" for thread in threading.enumerate()):
            time.sleep(0.01)
        time.sleep(0.1)
        pad = VirtualPad()
        assert self._steers.wait(30.0)
        self._acts(pad, self)


def presses(pad: VirtualPad, person: Person) -> None:
    for _ in range(PRESSES):
        person.done.append(Watch.now)
        pad.press(A)
        time.sleep(random.uniform(0.03, 0.1))
        pad.press(A, down=False)
        time.sleep(random.uniform(0.03, 0.1))
    pad.press(B)


def moves(pad: VirtualPad, person: Person) -> None:
    way = 1.0
    for _ in range(MOVES):
        person.done.append(Watch.now)
        pad.move(RIGHT_Y, way)
        way = -way
        time.sleep(random.uniform(0.1, 0.2))
    pad.press(B)


def leaves(pad: VirtualPad, person: Person) -> None:
    pad.move(RIGHT_Y, -1.0)
    time.sleep(0.5)
    pad.unplug()


def flight_of_a_person(acts: Any, out: Any) -> Person:
    person = Person(acts)
    person.start()
    Watch.turned = []
    flight = fly(steered_flight(), RunRequest(out=out / "run", speed=1.0), (person.hear,))
    assert flight.summary["vehicles"]["a"]["final"] == "ground", flight.summary
    person.join(5.0)
    return person


def late(done: list[int], seen: list[int]) -> float:
    """The median delay."""
    return statistics.median(b - a for a, b in zip(done, seen, strict=True))


@pytest.mark.thorough
def test_a_button_is_an_event_within_fifty_milliseconds(tmp_path: Any) -> None:
    person = flight_of_a_person(presses, tmp_path)
    assert late(person.done, [event.time for event in named(person.told, "stick.a")]) < MOST


@pytest.mark.thorough
def test_a_stick_moves_the_setpoint_within_fifty_milliseconds(tmp_path: Any) -> None:
    person = flight_of_a_person(moves, tmp_path)
    turned = [t for t in Watch.turned if t > person.done[0]][: len(person.done)]
    assert late(person.done, turned) < MOST


@pytest.mark.thorough
def test_a_gamepad_that_is_plugged_out_brakes_and_takes_the_way_out(tmp_path: Any) -> None:
    person = flight_of_a_person(leaves, tmp_path)
    [lost] = named(person.told, "input_lost")
    assert "is unplugged" in str(lost.fields["reason"])
    [failed] = named(person.told, "behavior_failed")
    assert pytest.approx(0.5, abs=0.05) == (failed.time - lost.time) / NS
    assert path(person.told, "a") == ["up", "hand", "down", "landed"]
