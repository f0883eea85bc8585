"""What conditions and expectations ask that no flight can answer: KYB257 and KYB258."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass

from kybflow.core.signals import Battery
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.certain import Asked, conditions_of, expectations_of
from kybflow.dsl.checks.links import reached_states
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import Vehicle
from kybflow.dsl.expressions import Compare, GroupInState, InState, Read, Word
from kybflow.dsl.expressions.tree import Aggregate
from kybflow.parts.observables import chains_of

_ESTIMATED = ("state.", "estimate.", "position_error", "velocity_error", "estimator")


def never_entered(case: Case) -> Iterator[Diagnostic]:
    """KYB257: a condition or an expectation asks for a state that its vehicle never enters.

    The state exists, but no arrow, callback or flow leads to it; it came through `like`, else
    KYB204 would say so. A statistic of it is of no tick, an `eventually` of it fails.
    """
    never = {v.name.text: _never(v) for v in case.vehicles()}
    if not any(never.values()):
        return
    for asked in (*case.once(conditions_of), *case.once(expectations_of)):
        for vehicle, state in _states(asked):
            if state in never.get(vehicle, ()):
                yield Diagnostic(
                    "KYB257",
                    f"`{vehicle}` never enters `{state}`",
                    asked.text.span,
                    label="nothing to look at",
                    help=f"let an arrow lead to `{state}`, or ask for another state",
                )


def _never(vehicle: Vehicle) -> frozenset[str]:
    reached = reached_states(vehicle)
    if not vehicle.states.keys() & reached:
        return frozenset()
    entered = {name for state in reached for name in (state, *chains_of(state))}
    inherited = [name for name, state in vehicle.states.items() if state.inherited]
    known = {name for state in inherited for name in (state, *chains_of(state))}
    return frozenset(known - entered)


def _states(asked: Asked) -> Iterator[tuple[str, str]]:
    for node in _nodes(asked.meant):
        match node:
            case InState(vehicle, state):
                yield vehicle, state
            case GroupInState(_, _, vehicles, state):
                yield from ((vehicle, state) for vehicle in vehicles)
            case Aggregate(_, _, str(vehicle), str(state)):
                yield vehicle, state
            case Compare(_, Read(vehicle, "behavior"), Word(state)):
                yield vehicle or asked.own or "", state


def not_measured(case: Case) -> Iterator[Diagnostic]:
    """KYB258: a condition or an expectation asks for a value that the vehicle never has.

    The battery is known where the target's driver reports it; where the vehicle is, and how far
    from its setpoint, where it has an estimator. A comparison with a value that is not known is
    false.
    """
    if not any(_lacking(v, name) for v in case.vehicles() for name in ("battery.", *_ESTIMATED)):
        return
    for asked in (*case.once(conditions_of), *case.once(expectations_of)):
        for node in _nodes(asked.meant):
            vehicle = case.document.vehicles.get(_subject(node, asked))
            if vehicle is None or not isinstance(node, Read):
                continue
            lacking = _lacking(vehicle, node.name)
            if lacking:
                yield Diagnostic(
                    "KYB258",
                    f"`{node.name}` of `{vehicle.name.text}` is never known",
                    asked.text.span,
                    label=lacking,
                    help="ask for something else, or change what the vehicle has",
                )


def _subject(node: object, asked: Asked) -> str:
    return (node.vehicle or asked.own or "") if isinstance(node, Read) else ""


def _lacking(vehicle: Vehicle, name: str) -> str:
    """What the vehicle would need to know a value; empty when it has that."""
    driver = vehicle.driver
    if name.startswith("battery.") and Battery not in driver.spec.cls.provides:
        return f"`{driver.name.text}` reports no battery"
    if name.startswith(_ESTIMATED) and not vehicle.estimators:
        return f"`{vehicle.name.text}` has no estimator"
    return ""


def _nodes(node: object) -> Iterator[object]:
    """A node of an expression and all below it."""
    yield node
    if isinstance(node, tuple):
        for inner in node:
            yield from _nodes(inner)
    elif is_dataclass(node):
        for field in fields(node):
            yield from _nodes(getattr(node, field.name))
