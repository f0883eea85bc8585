"""Supervision: bounds that are crossed at once or never (KYB416 and KYB417), alarms that nothing
reacts to (KYB446), rotors that stop in the air (KYB418), and reactions that come too late
(KYB593)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import sqrt
from typing import Any, NamedTuple

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import Reaction
from kybflow.core.units import LENGTH, SPEED, format_quantity
from kybflow.dsl.checks.case import Case, contexts, objected, transitions_of
from kybflow.dsl.checks.conditions import conditions_of
from kybflow.dsl.checks.envelopes import reaches_of
from kybflow.dsl.checks.estimators import latency_allowed
from kybflow.dsl.checks.space import footprints, the_loop, the_part
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Text
from kybflow.dsl.expressions.reasoning import Bounds, never_holds
from kybflow.dsl.expressions.tree import Read
from kybflow.dsl.plan import PartPlan, TransitionPlan, VehiclePlan
from kybflow.parts import GROUND, Objection
from kybflow.world.vehicle_context import InnerLoop


def crossed_at_once(case: Case) -> Iterator[Diagnostic]:
    """KYB416: a bound of a supervisor, a processor or an estimator is crossed as soon as the
    vehicle flies.

    For example, it is shorter than a tick, more precise than any estimate, or wider than the
    distance between the vehicles' starts. Each part decides that for itself.
    """
    for found in case.cached(_objections):
        if not found.objection.is_doubt:
            yield _finding("KYB416", found)


def of_little_help(case: Case) -> Iterator[Diagnostic]:
    """KYB417: a bound of a supervisor, a processor or an estimator is never crossed, crossed too
    late to help, or crossed in normal flights (a warning)."""
    for found in case.cached(_objections):
        if found.objection.is_doubt:
            yield _finding("KYB417", found)


class _Objected(NamedTuple):
    """An objection of a part, and the other places in the mission that it follows from."""

    part: PartPlan
    objection: Objection
    related: tuple[Related, ...]


def _objections(case: Case) -> Iterator[_Objected]:
    for vehicle, own in case.cached(contexts):
        context, allowed = own, latency_allowed(case, vehicle)
        if allowed is not None and own.loop is not None:
            context = own._replace(loop=own.loop._replace(pose_latency=allowed))
        estimators = (use.part for use in vehicle.estimators)
        for part in (*estimators, *vehicle.supervisors, *vehicle.processors):
            for objection in part.cls.objections(part.params, context):
                related = the_loop(vehicle)
                if related and objection in part.cls.objections(
                    part.params, own._replace(loop=_usual_loop(vehicle))
                ):
                    related = ()
                yield _Objected(part, objection, related)


def _usual_loop(vehicle: VehiclePlan) -> InnerLoop | None:
    """Return the on-board loop of a vehicle whose driver has its default parameters."""
    driver = vehicle.driver
    usual = {f.name: f.default for f in driver.fields if not f.required}
    loop: InnerLoop | None = driver.cls.inner_loop(
        replace(driver.params, **usual), vehicle.airframe
    )
    return loop


def _finding(code: str, found: _Objected) -> Diagnostic:
    return objected(code, found.part.alias, found.part, found.objection, found.related)


def nobody_lands_it(case: Case) -> Iterator[Diagnostic]:
    """KYB446: a supervisor that would land a vehicle by default only warns, and nothing else reacts
    to its alarm (a warning).

    Another supervisor of the same kind that lands the vehicle is enough, and so is a transition or
    a callback that waits for the event. For a battery supervisor, so is a condition on the battery.
    """
    for vehicle in case.plan.vehicles:
        for part in vehicle.supervisors:
            alike = (other for other in vehicle.supervisors if other.name == part.name)
            if not all(map(_only_warns, alike)):
                continue
            if any(event in part.cls.events for event in case.cached(_answered)):
                continue
            yield Diagnostic(
                "KYB446",
                f"nothing lands `{vehicle.name}` when `{part.alias}` raises its alarm",
                part.span_of("reaction"),
                label="only warns",
                help="remove `reaction`, or let a transition wait for its event",
                severity=Severity.WARNING,
            )


def _only_warns(part: PartPlan) -> bool:
    """Return whether a supervisor would land the vehicle by default but is set to warn."""
    if not part.is_written("reaction") or part.params.reaction != "warn":
        return False
    return Reaction[_usual(part).reaction.upper()] >= Reaction.LAND


def _answered(case: Case) -> Iterator[str]:
    """Yield the bare name of each event to which something reacts. A condition on the battery
    counts as a reaction to all events of a battery supervisor."""
    plan = case.plan
    transitions = list(transitions_of(plan))
    asked = (one.text_of("when") for one in (*transitions, *plan.callbacks))
    if any(text is not None and "battery." in text.text for text in asked):
        yield from (
            event
            for v in case.plan.vehicles
            for p in v.supervisors
            if p.cls.reserve(_usual(p)) > 0.0
            for event in p.cls.events
        )
    heard = [t.event for t in transitions]
    heard += [c.event for c in plan.callbacks if any(a.name != "log" for a in c.do)]
    yield from (event.rpartition(".")[2] for event in heard if event)


def _usual(part: PartPlan) -> Any:
    """Return the part's parameters with the default reaction, if it has one."""
    usual = {f.name: f.default for f in part.fields if f.name == "reaction"}
    return replace(part.params, **usual)


_JUST = 1.02
"""How far a value passes a bound before an alarm comes, as a factor."""


def too_late_to_react(case: Case) -> Iterator[Diagnostic]:
    """KYB593: a transition in the air waits for a charge, a tilt, or an age or a spread of the
    estimate at which a supervisor has ended the flight (a warning)."""
    owners = {typed.own for typed in case.cached(conditions_of)}
    for vehicle in case.plan.vehicles:
        ends = {
            name: (part, low / _JUST, high * _JUST)
            for part in (vehicle.supervisors if vehicle.name in owners else ())
            for name, (low, high) in part.cls.ends_outside(part.params).items()
        }
        for transition, text in _asked_in_the_air(vehicle) if ends else ():
            name = next((name for name in ends if name in text.text), "")
            scope = case.scopes.condition(vehicle.name) if name else None
            condition = case.condition(transition, "when", scope) if scope else None
            if condition is None:
                continue
            part, usual = ends[name][0], reaches_of(case)(vehicle.name).usual
            known = {name: (low, high) for name, (_, low, high) in ends.items()}
            is_late = never_holds(condition, _limited(vehicle.name, known, usual))
            if is_late and not never_holds(condition, usual):  # else KYB253 or KYB410
                yield Diagnostic(
                    "KYB593",
                    f"`{text.as_written}` comes after `{part.alias}` has ended the flight",
                    text.span,
                    label="this transition is never taken",
                    help=f"react earlier, or let `{part.alias}` react later",
                    severity=Severity.WARNING,
                    related=the_part(vehicle, part),
                )


def _asked_in_the_air(vehicle: VehiclePlan) -> Iterator[tuple[TransitionPlan, Text]]:
    """Yield the transitions with a condition out of states in the air, one of each condition."""
    asked = set[str]()
    for state in vehicle.states.values():
        for transition in () if any(GROUND in leg for leg in state.legs) else state.transitions:
            text = transition.text_of("when")
            if text is not None and text.text not in asked:
                asked.add(text.text)
                yield transition, text


def _limited(own: str, known: Mapping[str, tuple[float, float]], usual: Bounds) -> Bounds:
    """Return bounds that limit the values of a vehicle in `known`."""

    def bounds(value: object) -> tuple[float, float]:
        match value:
            case Read(who, name) if who in (None, own) and name in known:
                return known[name]
        return usual(value)

    return bounds


def falls(case: Case) -> Iterator[Diagnostic]:
    """KYB418: a supervisor stops the rotors in the air (a warning).

    From a height h a vehicle hits the ground at sqrt(2 g h), where h is the highest place to which
    the mission flies it, or else the top of the fence.
    """
    for vehicle in case.plan.vehicles:
        for part in vehicle.supervisors:
            if getattr(part.params, "reaction", None) != "cut":
                continue
            ways = (way for owner, _, _, way in case.cached(footprints) if owner is vehicle)
            heights = [point[2] for way in ways for point in way.points]
            top = vehicle.start[2] if case.plan.fence is None else case.plan.fence.high[2]
            height = max(0.0, max(heights, default=top) - vehicle.start[2])
            speed = format_quantity(sqrt(2.0 * GRAVITY * height), SPEED)
            yield Diagnostic(
                "KYB418",
                f"`{part.alias}` lets `{vehicle.name}` fall",
                part.span_of("reaction"),
                label="stops the rotors in the air",
                notes=(f"from {format_quantity(height, LENGTH)} it hits the ground at {speed}",),
                help="write `reaction: land_blind`, unless a fall is the least harmful",
                severity=Severity.WARNING,
            )
