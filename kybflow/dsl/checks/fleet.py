"""Checks for things that two vehicles can't share, and for vehicles that wait for each other:
KYB440, KYB441 and KYB443."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import NamedTuple

from kybflow.core.geometry import distance
from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.reachability import endless_states
from kybflow.dsl.checks.space import shown_point
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.expressions import (
    tree,
)
from kybflow.dsl.names import BUILT_IN, end_of
from kybflow.dsl.plan import PartPlan, StatePlan, VehiclePlan
from kybflow.parts import AIR, Claim
from kybflow.parts.observables import is_in

_MAX_HEIGHT = 0.2
"""Height above its start at which the estimate of a standing vehicle is certain not to be, m."""


def taken_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB440: two vehicles claim something that only one can have on the target: a body of motion
    capture, a system id at one address, a device. The vehicles would be mistaken for each other, or
    one would lack it."""
    first: dict[str, tuple[VehiclePlan, PartPlan]] = {}
    for vehicle, part, claim in _claims(case):
        owner, other = first.setdefault(claim.what, (vehicle, part))
        if owner is vehicle:
            continue
        yield Diagnostic(
            "KYB440",
            f"`{vehicle.name}` and `{owner.name}` both have {claim.what}",
            part.span_of(claim.parameter),
            notes=(f"`{owner.name}` has it at {other.span.at}",),
            help=f"give each its own `{claim.parameter}`",
        )


def _claims(case: Case) -> Iterator[tuple[VehiclePlan, PartPlan, Claim]]:
    if len(case.plan.fleet) < 2:
        return
    seats: Counter[str] = Counter()
    for vehicle in case.plan.vehicles:
        name, driver = vehicle.name, vehicle.driver
        seats[driver.name] += 1
        claims = [(driver, driver.cls.claim(driver.params, name, seats[driver.name]))]
        for sensor in vehicle.sensors:
            claims.append((sensor.part, sensor.part.cls.claim(sensor.part.params, name)))
        yield from ((vehicle, part, claim) for part, claim in claims if claim is not None)


def homes_in_one_place(case: Case) -> Iterator[Diagnostic]:
    """KYB441: the homes of two vehicles are so close that the vehicles would touch. Home is where
    `go_home` flies and where the failsafe may land; by default it is the start."""
    vehicles = case.plan.vehicles
    for index, b in enumerate(vehicles):
        for a in vehicles[:index]:
            written = b.entry("home") or a.entry("home")
            apart = (a.airframe.diameter + b.airframe.diameter) / 2.0
            gap = distance(a.home or a.start, b.home or b.start)
            if written is None or gap >= apart:
                continue
            yield Diagnostic(
                "KYB441",
                f"the homes of `{b.name}` and `{a.name}` are too close",
                written.value.span,
                label=f"{format_quantity(gap, LENGTH)} away",
                notes=(f"the home of `{a.name}` is at {shown_point(a.home or a.start)}",),
                help=f"keep them at least {format_quantity(apart, LENGTH)} apart",
                severity=Severity.WARNING,
            )
            break


class _Settled(NamedTuple):
    """Where a vehicle ends up by itself. state: the state in which it stays; None if it rests for
    good. seen: every state that it may have been in by then, including after failures."""

    vehicle: VehiclePlan
    state: StatePlan | None
    seen: frozenset[str]

    @property
    def is_grounded(self) -> bool:
        """Whether the vehicle has never left the ground."""
        states = self.vehicle.states
        legs = (leg for name in self.seen & states.keys() for leg in states[name].legs)
        return self.seen <= states.keys() and not any(AIR in leg for leg in legs)

    @property
    def where(self) -> str:
        name = self.vehicle.name
        if self.state is None:
            return f"`{name}` has ended by then"
        return f"`{name}` waits in `{self.state.name}`"


def wait_for_each_other(case: Case) -> Iterator[Diagnostic]:
    """KYB443: a behavior without an end is never left: each of its transitions waits for another
    vehicle to be in a state, and that vehicle waits in turn or never enters the state.

    Checked are vehicles that reach such a behavior by `then` alone and that no flow or callback
    controls. Only conditions that name the state of a vehicle count.
    """
    settled = {s.vehicle.name: s for v in case.plan.vehicles if (s := _settled(v)) is not None}
    waiting = {name for name, s in settled.items() if s.state is not None and _has_next(s.state)}
    while waiting:
        leaving = {name for name in waiting if not _is_stuck(case, settled, name, waiting)}
        if not leaving:
            break
        waiting -= leaving
        for name in leaving:
            del settled[name]
    for name in sorted(waiting):
        state = settled[name].state
        assert state is not None
        others = " and ".join(f"`{other}`" for other in sorted(_awaited(case, name, state)))
        yield Diagnostic(
            "KYB443",
            f"`{name}` waits in `{state.name}` forever",
            state.span,
            label=f"waits for {others}",
            notes=tuple(settled[other].where for other in sorted(_awaited(case, name, state))),
            help="add a `next` with `after: 60 s`, or an event such as `operator.go`",
        )


def _has_next(state: StatePlan) -> bool:
    return any(transition.cause == "next" for transition in state.transitions)


def _settled(vehicle: VehiclePlan) -> _Settled | None:
    """Return where a vehicle ends up through `then` alone; None if anything else may lead
    elsewhere."""
    if vehicle.requested:
        return None
    name, passed, endless = vehicle.begin, dict[str, StatePlan](), endless_states(vehicle)
    while name in vehicle.states and name not in passed:
        state = passed[name] = vehicle.states[name]
        if name in endless:
            return _Settled(vehicle, state, _seen(vehicle, passed.values()))
        if _has_next(state):
            return None
        then = next((t.target for t in state.transitions if t.cause == "then"), None)
        name = end_of(state.legs) if then is None else then
    return (
        None if name in vehicle.states else _Settled(vehicle, None, _seen(vehicle, passed.values()))
    )


def _seen(vehicle: VehiclePlan, passed: Collection[StatePlan]) -> frozenset[str]:
    """Return the states in `passed` and all states to which their failures may lead."""
    seen = {state.name for state in passed}
    failures = {t.target for s in passed for t in s.transitions if t.cause != "next"} - seen
    while failures:
        seen |= failures
        states = (vehicle.states[name] for name in failures if name in vehicle.states)
        failures = {t.target for state in states for t in state.transitions} - seen
    return frozenset(seen)


def _is_stuck(case: Case, settled: dict[str, _Settled], name: str, waiting: set[str]) -> bool:
    """Return whether a vehicle stays in its state as long as the `waiting` vehicles wait."""
    own = settled[name].state
    assert own is not None
    scope = case.scopes.condition(name)
    for transition in own.transitions:
        if transition.cause == "then":
            continue
        when = case.condition(transition, "when", scope)
        if when is None or not _is_barred(when, settled, waiting):
            return False
    return True


def _is_barred(when: tree.Condition, settled: dict[str, _Settled], waiting: set[str]) -> bool:
    """Return whether a condition can't become true while the vehicles stay in the states in which
    they ended up."""
    match when:
        case tree.And(parts):
            return any(_is_barred(part, settled, waiting) for part in parts)
        case tree.Or(parts):
            return all(_is_barred(part, settled, waiting) for part in parts)
        case tree.GroupInState("all", _, vehicles, state):
            return any(_never_in(settled, waiting, v, state) for v in vehicles)
        case tree.GroupInState("any", _, vehicles, state):
            return all(_never_in(settled, waiting, v, state) for v in vehicles)
        case tree.InState(vehicle, state):
            return _never_in(settled, waiting, vehicle, state)
        case tree.Compare("==", tree.Read(vehicle, "behavior"), tree.Word(state)) if (
            vehicle is not None
        ):
            return _never_in(settled, waiting, vehicle, state)
        case tree.Compare(">" | ">=", tree.Read(vehicle, "state.altitude"), tree.Quantity(height)):
            other = None if vehicle is None else _resting(settled, waiting, vehicle)
            return (
                other is not None
                and other.is_grounded
                and height > other.vehicle.start[2] + _MAX_HEIGHT
            )
    return False


def _never_in(settled: dict[str, _Settled], waiting: set[str], name: str, state: str) -> bool:
    """Return whether a vehicle that stays in its final state was never in `state`. False for
    built-in states, because the failsafe may enter them."""
    other = _resting(settled, waiting, name)
    if other is None or state in BUILT_IN:
        return False
    return not any(is_in(seen, state) for seen in other.seen)


def _resting(settled: dict[str, _Settled], waiting: set[str], name: str) -> _Settled | None:
    """Return where the named vehicle ends up, if it stays there while the `waiting` vehicles wait;
    otherwise None."""
    other = settled.get(name)
    if other is None or name in waiting or other.state is None:
        return other
    return None if other.state.transitions else other


def _awaited(case: Case, name: str, state: StatePlan) -> set[str]:
    """Return the vehicles for which the transitions of a state wait."""
    scope = case.scopes.condition(name)
    conditions = [case.condition(t, "when", scope) for t in state.transitions]
    return {v for when in conditions if when is not None for v in _named(when)} - {name}


def _named(when: tree.Condition) -> Iterator[str]:
    match when:
        case tree.And(parts) | tree.Or(parts):
            for part in parts:
                yield from _named(part)
        case tree.GroupInState(_, _, vehicles, _):
            yield from vehicles
        case tree.InState(vehicle, _):
            yield vehicle
        case tree.Compare(_, tree.Read(vehicle), _) if vehicle is not None:
            yield vehicle
