"""Faults are injected at their time or when their condition first holds, and mended in time."""

from __future__ import annotations

import random
from typing import ClassVar

import pytest
from plans import part

from kybflow.core.signals import NS, Battery, Event
from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.expressions import Scope, parse
from kybflow.dsl.plan import FaultPlan, PartPlan
from kybflow.parts import ActiveFaults, Effect, Fault
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.injection import Injection


class Flight:
    """An injection, ticked; `holds` is what every condition gives."""

    def __init__(self, *faults: FaultPlan, seed: int = 0) -> None:
        self.told: list[Event] = []
        self.holds = False
        self.asked: list[str] = []
        self.rigs = {"a": ActiveFaults("a"), "b": ActiveFaults("b")}
        self.events = Events((self.told.append,))
        self.injection = Injection(faults, self.rigs, self._condition, self.events, seed)

    def _condition(self, vehicle):
        self.asked.append(vehicle)
        return lambda expression: lambda: self.holds

    def tick(self, seconds: float) -> None:
        now = round(seconds * NS)
        self.events.turn(now)
        self.injection.step(now)

    @property
    def path(self) -> list[tuple[float, str, str, str]]:
        return [(e.time / NS, e.name, e.vehicle, str(e.fields["fault"])) for e in self.told]


def heavy(time=None, lasts=None, when=None, vehicle="a", at="m.yaml:7") -> FaultPlan:
    fault = part("faults", "mass_change", factor=1.2)
    return FaultPlan(part=fault, vehicle=vehicle, time=time, when=when, duration=lasts, at=at)


def condition():
    expression, found = parse(
        Text("elapsed > 1 s", Span("m.yaml", 1, 1, 1, 2)), Scope("condition", {}, "a")
    )
    assert not found
    return expression


def test_a_fault_works_from_its_time_for_its_duration() -> None:
    flight = Flight(heavy(2.0, 1.5))
    masses = []
    for seconds in (0.0, 1.996, 2.0, 3.496, 3.5, 9.0):
        flight.tick(seconds)
        masses.append(flight.rigs["a"].mass)
    assert masses == [1.0, 1.0, 1.2, 1.2, 1.0, 1.0]
    assert flight.path == [
        (2.0, "fault_injected", "a", "mass_change"), (3.5, "fault_ended", "a", "mass_change"),
    ]  # fmt: skip
    assert {event.at for event in flight.told} == {"m.yaml:7"}
    assert flight.rigs["b"].mass == 1.0


def test_without_a_duration_it_stays() -> None:
    flight = Flight(heavy(1.0))
    for seconds in (1.0, 100.0):
        flight.tick(seconds)
    assert flight.rigs["a"].mass == 1.2


def test_a_condition_injects_once_the_first_time() -> None:
    flight = Flight(heavy(when=condition(), lasts=1.0, vehicle="b"))
    assert flight.asked == ["b"]
    for seconds, holds in ((0.0, False), (1.0, True), (2.0, False), (3.0, True), (4.0, True)):
        flight.holds = holds
        flight.tick(seconds)
    assert [entry[:2] for entry in flight.path] == [(1.0, "fault_injected"), (2.0, "fault_ended")]


def test_faults_of_one_tick_come_in_the_order_of_the_mission() -> None:
    sag = FaultPlan(part=part("faults", "battery_sag"), vehicle="b", time=1.0)
    flight = Flight(heavy(1.0), sag, heavy(1.0, vehicle="b"))
    flight.tick(1.0)
    assert [(e.vehicle, e.fields["fault"]) for e in flight.told] == [
        ("a", "mass_change"), ("b", "battery_sag"), ("b", "mass_change"),
    ]  # fmt: skip


def test_a_swap_breaks_both_and_mends_both() -> None:
    swap = part("faults", "mocap_swap", other="b")
    flight = Flight(FaultPlan(part=swap, vehicle="a", time=1.0, duration=1.0))
    flight.tick(1.0)
    assert [rig.body for rig in flight.rigs.values()] == ["b", "a"]
    flight.tick(2.0)
    assert [rig.body for rig in flight.rigs.values()] == ["a", "b"]


class Chancy(Fault[None]):
    drawn: ClassVar[list[float]] = []

    def effects(self, vehicle):
        self.drawn.append(self.generator.random())
        return {vehicle: Effect(mass=2.0)}


class Broken(Fault[None]):
    def effects(self, vehicle):
        raise ZeroDivisionError("no")


def plan_of(cls) -> PartPlan:
    return PartPlan(cls.__name__.lower(), cls, None, "")


def test_chance_is_that_of_the_run_and_of_the_faults_place() -> None:
    def draws(seed):
        Chancy.drawn = []
        flight = Flight(*[FaultPlan(part=plan_of(Chancy), vehicle="a", time=0.0)] * 2, seed=seed)
        flight.tick(0.0)
        return Chancy.drawn

    assert draws(1) == draws(1)
    assert draws(1) != draws(2)
    assert len(set(draws(1))) == 2
    assert draws(1)[0] != random.Random(1).random()


@pytest.mark.parametrize("fault", [plan_of(Broken), part("faults", "mocap_swap", other="nobody")])
def test_a_fault_that_cannot_be_injected_is_told_and_fails_the_run(fault: PartPlan) -> None:
    flight = Flight(FaultPlan(part=fault, vehicle="a", time=1.0), heavy(1.0))
    flight.tick(1.0)
    assert [entry[1] for entry in flight.path] == ["fault_failed", "fault_injected"]
    assert flight.injection.failure is not None
    assert fault.name in flight.injection.failure
    assert flight.rigs["a"].body == "a"


class AtWork(Fault[None]):
    """Works for `HEALTHY` measurements and blows for as many seconds; then both go wrong as `way`
    says."""

    HEALTHY = 2
    way: ClassVar[str]

    def effects(self, vehicle):
        self.seen = 0
        return {vehicle: Effect(filter=self.change, wind=self.blow, mass=2.0)}

    def change(self, measurement):
        self.seen += 1
        if self.seen <= self.HEALTHY:
            return measurement._replace(voltage=1.0)
        if self.way == "raises":
            raise ZeroDivisionError("no")
        return "half charged"

    def blow(self, seconds):
        if seconds < self.HEALTHY:
            return (1.0, 0.0, 0.0)
        if self.way == "raises":
            raise ZeroDivisionError("no")
        return (float("nan"), 0.0, 0.0)


def at_work(way: str) -> Flight:
    cls = type(way, (AtWork,), {"way": way})
    flight = Flight(FaultPlan(part=plan_of(cls), vehicle="a", time=0.0, at="m.yaml:7"))
    flight.tick(0.0)
    return flight


REASON = {
    "raises": "ZeroDivisionError: no",
    "odd": "TypeError: its filter returned 'half charged' for",
}


@pytest.mark.parametrize("way", REASON)
def test_a_filter_that_fails_at_work_is_left_out(way: str) -> None:
    flight, report = at_work(way), Battery(0, 0.5, 14.0)
    [change] = flight.rigs["a"].filters
    assert [change(report).voltage for _ in range(4)] == [1.0, 1.0, 14.0, 14.0]
    assert [entry[1] for entry in flight.path] == ["fault_injected", "fault_failed"]
    assert f"the fault `{way}` failed at work: {REASON[way]}" in str(flight.injection.failure)
    assert flight.rigs["a"].mass == 2.0
    flight.tick(0.004)
    assert (flight.rigs["a"].filters, flight.rigs["a"].mass) == ((), 1.0)
    flight.tick(1.0)
    assert len(flight.told) == 2


@pytest.mark.parametrize(("way", "reason"), [("raises", "Zero"), ("odd", "its wind is not finite")])
def test_a_wind_that_fails_at_work_is_left_out(way: str, reason: str) -> None:
    flight = at_work(way)
    winds = [flight.rigs["a"].wind(seconds * NS) for seconds in range(4)]
    assert winds == [(1.0, 0.0, 0.0)] * 2 + [(0.0, 0.0, 0.0)] * 2
    assert reason in str(flight.injection.failure)
    flight.tick(4.0)
    assert not flight.rigs["a"].blows
    assert [entry[1] for entry in flight.path] == ["fault_injected", "fault_failed"]


def test_of_a_fault_that_cannot_be_injected_nothing_stays() -> None:
    def changed() -> None:
        if flight.rigs["a"].mass == 2.0:
            raise ZeroDivisionError("no world has that")

    flight = Flight(FaultPlan(part=plan_of(Chancy), vehicle="a", time=1.0))
    flight.rigs["a"] = flight.injection._active["a"] = ActiveFaults("a", changed)
    flight.tick(1.0)
    assert [entry[1] for entry in flight.path] == ["fault_failed"]
    assert flight.rigs["a"].mass == 1.0
