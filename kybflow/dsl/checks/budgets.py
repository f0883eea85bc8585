"""Time and energy that a mission needs, as lower bounds for a flight without failures, compared
with what it allows: KYB430 to KYB435, KYB448, KYB455, KYB456 and KYB575."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from math import inf
from typing import Any

from kybflow.core.params import fields_of
from kybflow.core.units import DURATION, RATIO, format_quantity
from kybflow.dsl.checks.barriers import flow_ways
from kybflow.dsl.checks.case import Case, bounded_parameters
from kybflow.dsl.checks.durations import (
    Way,
    blamed,
    disturbances,
    exceeds,
    least_time,
    longest_time,
    no_way_exceeds,
    quickest_into,
    seconds_of,
    sum_of,
    ways_from,
)
from kybflow.dsl.checks.faults import misleads
from kybflow.dsl.checks.reachability import FlightNode, endless_states, entries_of, flight_graph
from kybflow.dsl.checks.space import the_time_limit
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span
from kybflow.dsl.expressions import (
    tree,
)
from kybflow.dsl.names import end_of
from kybflow.dsl.plan import StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.parts.observables import is_in

_BOUND_FACTOR = 3.0
"""A wait of up to this many times a behavior's longest duration may be meant as an upper bound."""
_WITHIN_FACTOR = 2.0
"""A behavior's time may be up to this many times its `within`, if it is meant as a bound."""
_AT_ONCE = 0.1
"""Time in which no vehicle moves noticeably, s."""


def within_too_short(case: Case) -> Iterator[Diagnostic]:
    """KYB430: a `within` expires before the behavior or chain can have ended by itself, wherever it
    is entered. If both lead to the same state, it is a warning."""
    for vehicle, state, transition in case.cached(_timed):
        if transition.cause == "within" and transition.after is not None:
            least, what = least_time(case, vehicle, state), state.name
            if transition.since:
                least, what = _least_of_chain(case, vehicle, state, transition), transition.since
            if exceeds(least, transition.after):
                then = next((t.target for t in state.transitions if t.cause == "then"), None)
                end = end_of(state.behavior.cls.flight) if then is None else then
                yield Diagnostic(
                    "KYB430",
                    f"`{what}` can't end within {seconds_of(transition.after)}",
                    transition.span,
                    label=f"needs at least {seconds_of(least)}",
                    help="allow more time, or shorten the flight",
                    severity=Severity.WARNING if end == transition.target else Severity.ERROR,
                )


def _least_of_chain(
    case: Case, vehicle: VehiclePlan, state: StatePlan, transition: TransitionPlan
) -> float:
    """Return the least time that a vehicle spends in a chain, s, if `state` is the chain's first
    state; 0 for its other states."""
    chain = transition.since
    limit = transition.after or 0.0
    if vehicle.goal(chain) != state.name or no_way_exceeds(case, vehicle, limit):
        return 0.0
    first = [node for node in flight_graph(case, vehicle).nodes if node.state == state.name]
    ways = ways_from(case, vehicle, first, lambda node: is_in(node.state, chain))
    return min((w.seconds for n, w in ways.items() if not is_in(n.state, chain)), default=0.0)


def cut_short(case: Case) -> Iterator[Diagnostic]:
    """KYB431: a `next` that waits only for time leaves a behavior before it can end, so its `then`
    is never taken."""
    for vehicle, state, transition in case.cached(_timed):
        if transition.cause != "next" or transition.after is None or transition.since:
            continue
        if transition.when is not None or transition.event is not None:
            continue
        then = next((t for t in state.transitions if t.cause == "then" and not t.since), None)
        least = least_time(case, vehicle, state)
        if then is None or then.target == transition.target:
            continue
        if exceeds(least, transition.after):
            yield Diagnostic(
                "KYB431",
                f"`{state.name}` is left before it can end",
                transition.span,
                label=f"after {seconds_of(transition.after)}, but it needs {seconds_of(least)}",
                notes=(f"`{then.target}`, its `then`, is never entered",),
                help="wait longer, or remove the `then`",
                severity=Severity.WARNING,
            )


def after_its_end(case: Case) -> Iterator[Diagnostic]:
    """KYB455: a `next` waits more than three times as long as the behavior can last, so it is never
    taken (a warning). A slightly longer wait is accepted as a bound."""
    for vehicle, state, transition in () if case.cached(disturbances) else case.cached(_timed):
        longest = inf if transition.since else longest_time(vehicle, state)
        wait = transition.after or 0.0
        if transition.cause == "next" and _BOUND_FACTOR * longest < wait < case.plan.time_limit:
            yield Diagnostic(
                "KYB455",
                f"`{state.name}` ends before this transition can be taken",
                transition.span,
                label=f"after {seconds_of(wait)}",
                notes=(f"`{state.behavior.name}` lasts at most {seconds_of(longest)}",),
                help="shorten the wait, or let the behavior last longer",
                severity=Severity.WARNING,
            )


def left_at_once(case: Case) -> Iterator[Diagnostic]:
    """KYB448: a behavior in the air is left within 0.1 s, before it has done anything (a
    warning)."""
    for vehicle, state in case.states():
        for transition in state.transitions:
            after = transition.after
            is_guarded = transition.when is not None or transition.event is not None
            if after is None or after >= _AT_ONCE or is_guarded:
                continue
            is_flown = any(leg.end is AIR for leg in state.behavior.cls.flight)
            if not is_flown or _is_told(case, vehicle, state, transition):
                continue
            yield Diagnostic(
                "KYB448",
                f"`{transition.since or state.name}` is left before it has done anything",
                transition.span,
                label=f"after {seconds_of(after)}",
                help="wait longer, or remove this transition",
                severity=Severity.WARNING,
            )


def _is_told(
    case: Case, vehicle: VehiclePlan, state: StatePlan, transition: TransitionPlan
) -> bool:
    """Return whether this transition is already reported, by KYB430 or KYB431 or at another state
    of the same chain."""
    if transition.since and vehicle.goal(transition.since) != state.name:
        return True
    if (vehicle, state, transition) not in case.cached(_timed):
        return False
    then = next((t for t in state.transitions if t.cause == "then" and not t.since), None)
    is_cut = then is not None and then.target != transition.target
    is_judged = transition.cause == "within" or (is_cut and not transition.since)
    least = least_time(case, vehicle, state)
    return is_judged and exceeds(least, transition.after or 0.0)


def _timed(case: Case) -> Iterator[tuple[VehiclePlan, StatePlan, TransitionPlan]]:
    """Yield every transition that waits for a time and that leaves a reachable state whose behavior
    ends by itself, or a chain."""
    for vehicle in case.plan.vehicles:
        endless = endless_states(vehicle)
        for name in entries_of(vehicle):
            state = vehicle.states[name]
            for transition in state.transitions:
                if transition.after is not None and (transition.since or name not in endless):
                    yield vehicle, state, transition


def beyond_the_time_limit(case: Case) -> Iterator[Diagnostic]:
    """KYB432: a vehicle can't have landed for good within the mission's time limit, whatever events
    and conditions occur: the run lands it early and fails.

    A run ends after `time_limit`, 600 s by default. A vehicle that takes off again after every
    landing never lands for good.
    """
    limit = case.plan.time_limit
    for vehicle in case.cached(_left_alone):
        again = _takes_off_again(case, vehicle)
        if again is not None:
            yield Diagnostic(
                "KYB432",
                f"`{vehicle.name}` takes off again after every landing",
                again.target_span,
                label="the mission never ends",
                notes=(f"its `time_limit` is {seconds_of(limit)}",),
                help="leave a landing without a `then`, or let a `next` end the cycle",
            )
            continue
        way = _way_to_rest(case, vehicle, limit)
        if way is None:
            continue
        states = (vehicle.states[name] for name, _ in way.steps() if name in vehicle.states)
        if any(max(t.after or 0.0, t.hold) >= limit for s in states for t in s.transitions):
            continue  # KYB259 reports a single wait
        yield Diagnostic(
            "KYB432",
            f"`{vehicle.name}` can't land within the mission's time limit",
            _place(case, vehicle, way),
            label=f"flies for at least {seconds_of(way.seconds)}",
            notes=(sum_of(way), f"its `time_limit` is {seconds_of(limit)}"),
            help="shorten the flight, or write a longer `time_limit`",
            related=the_time_limit(case),
        )


def _takes_off_again(case: Case, vehicle: VehiclePlan) -> TransitionPlan | None:
    """Return the `then` of a landing that leads to the next take-off, if the vehicle comes to rest
    nowhere and nothing stops the run."""
    states = vehicle.states
    thens = (t for s in states.values() if (AIR, GROUND) in s.legs for t in s.transitions)
    again = next(
        (t for t in thens if t.cause == "then" and t.target in states and not t.since), None
    )
    if again is None or (GROUND, AIR) not in states[again.target].legs:
        return None
    if any(action.name == "stop" for one in case.plan.callbacks for action in one.do):
        return None
    endless = endless_states(vehicle)
    for node in ways_from(case, vehicle, [_first(vehicle)]):
        state = states.get(node.state)
        if node.flight is GROUND and (
            state is None or not state.transitions or node.state in endless
        ):
            return None
    return again


def longer_than_its_patience(case: Case) -> Iterator[Diagnostic]:
    """KYB433: a parameter exceeds the parameter that limits it, so the behavior always fails: for
    example, it must stay at its goal longer than its timeout."""
    for _, state, part, field in case.cached(bounded_parameters):
        if field.limited_by is None or state is None:
            continue
        own, most = getattr(part.params, field.name), getattr(part.params, field.limited_by)
        if own is None or most is None or own <= most or field.dimension is None:
            continue
        written = [n for n in (field.name, field.limited_by) if part.is_written(n)]
        shown = [format_quantity(value, field.dimension) for value in (own, most)]
        yield Diagnostic(
            "KYB433",
            f"`{state.name}` ({part.name}) always fails",
            part.span_of(*written[:1]),
            label=f"its `{field.name}` of {shown[0]} exceeds its `{field.limited_by}`",
            notes=(f"`{field.limited_by}` is {shown[1]}",),
            help=f"make `{field.name}` smaller than `{field.limited_by}`",
        )


def longer_than_the_mission(case: Case) -> Iterator[Diagnostic]:
    """KYB575: a time for which a behavior waits is longer than the whole mission may last, or at
    least twice as long as the behavior's own `within`, so it never ends the behavior (a warning).

    The mission lasts no longer than its `time_limit`, and than an expectation `finished within`.
    """
    limit, what = case.plan.time_limit, "the mission's `time_limit`"
    for text, expression in case.expected():
        match expression:
            case tree.Finished(within) if within < limit:
                limit, what = within, f"`{text.as_written}`"
    for vehicle, state in case.states():
        part = state.behavior
        if state.built_in:
            continue
        for name in _times(part.params.__class__) & part.source.node.entries.keys():
            value = getattr(part.params, name)
            if value is None:
                continue
            own = [t.after for t in state.transitions if t.cause == "within" and t.after]
            allowed, by = limit, what
            if own and value >= _WITHIN_FACTOR * min(own):
                allowed, by = min(own), "its `within`"
            if value < allowed or least_time(case, vehicle, state) >= allowed:
                continue
            yield Diagnostic(
                "KYB575",
                f"`{name}` of `{state.name}` has no effect, because it is so long",
                part.span_of(name),
                label=f"{by} allows {seconds_of(allowed)}",
                help="write a shorter time",
                severity=Severity.WARNING,
            )


@functools.cache
def _times(params: Any) -> frozenset[str]:
    return frozenset(field.name for field in fields_of(params) if field.dimension is DURATION)


def out_of_energy(case: Case) -> Iterator[Diagnostic]:
    """KYB434: after a take-off the vehicle can't land before its battery is empty, or before a
    supervisor lands it because the battery is low.

    Hovering empties the battery within the airframe's `endurance`. A flight from rest to rest is
    taken to use at least as much as hovering for the same time.
    """
    for vehicle in case.cached(_left_alone):
        reserve, endurance = _reserve(vehicle), vehicle.airframe.endurance
        lasts = (1.0 - reserve) * endurance
        flights = () if no_way_exceeds(case, vehicle, lasts) else _flights(case, vehicle)
        way = next((way for way in flights if exceeds(way.seconds, lasts)), None)
        if way is None:
            continue
        hovers = f"its airframe hovers for {seconds_of(endurance)}"
        if reserve > 0.0:
            hovers += f", and a supervisor lands it at {format_quantity(reserve, RATIO)}"
        yield Diagnostic(
            "KYB434",
            f"the battery of `{vehicle.name}` doesn't last for this flight",
            _place(case, vehicle, way),
            label=f"in the air for at least {seconds_of(way.seconds)}",
            notes=(sum_of(way), hovers),
            help="shorten the flight, or land in between",
        )


def begins_empty(case: Case) -> Iterator[Diagnostic]:
    """KYB456: a vehicle's battery starts at or below the charge at which a supervisor lands it: the
    preflight check fails, or the vehicle lands right after take-off (a warning)."""
    for vehicle in case.plan.vehicles:
        driver = vehicle.driver
        charge = driver.cls.charge(driver.params)
        if charge is None or charge.share >= 1.0 or charge.share > _reserve(vehicle):
            continue
        yield Diagnostic(
            "KYB456",
            f"the battery of `{vehicle.name}` is too low at the start",
            driver.span_of(charge.parameter),
            label=f"starts at {format_quantity(charge.share, RATIO)}",
            notes=(f"a supervisor lands it at {format_quantity(_reserve(vehicle), RATIO)}",),
            help="start with a higher charge",
            severity=Severity.WARNING,
        )


def _reserve(vehicle: VehiclePlan) -> float:
    """Return the battery charge at which a supervisor lands the vehicle, from 0 to 1."""
    return max((s.cls.reserve(s.params) for s in vehicle.supervisors), default=0.0)


def _flights(case: Case, vehicle: VehiclePlan) -> Iterator[Way]:
    """Yield the quickest path from each take-off to the ground."""
    for node in flight_graph(case, vehicle).nodes:
        legs = case.legs(vehicle, node.state)
        if node.flight is not GROUND or all(leg.end is GROUND for leg in legs):
            continue
        ways = ways_from(case, vehicle, [node], lambda n: n.flight is not GROUND)
        down = [way for n, way in ways.items() if n.flight is GROUND and n != node]
        if down:
            yield min(down, key=lambda way: way.seconds)


def expected_too_soon(case: Case) -> Iterator[Diagnostic]:
    """KYB435: an expectation allows less time than the mission needs to finish, or to bring a
    vehicle into a state."""
    for text, expression in case.expected():
        if "within" not in text.text:
            continue
        way = _too_slow(case, expression)
        if way is not None:
            yield Diagnostic(
                "KYB435",
                f"`{text.as_written}` can't be met",
                text.span,
                label=f"takes at least {seconds_of(way.seconds)}",
                notes=(sum_of(way),),
                help="allow more time, or make the mission quicker",
            )


def _too_slow(case: Case, expectation: tree.Expression) -> Way | None:
    """Return the quickest path to the state that an expectation waits for, if it takes too long."""
    match expectation:
        case tree.Finished(limit):
            found = [_way_to_rest(case, vehicle, limit) for vehicle in case.cached(_left_alone)]
            found += [way for _, way in case.cached(flow_ways) if exceeds(way.seconds, limit)]
            is_enough = True
        case tree.Eventually(tree.InState(name, state), limit) if limit is not None:
            found, is_enough = [_way_into(case, name, state, limit)], True
        case tree.Eventually(tree.GroupInState(quantifier, _, names, state), limit) if (
            limit is not None
        ):
            found = [_way_into(case, name, state, limit) for name in names]
            is_enough = quantifier == "all"
        case _:
            return None
    slow = [way for way in found if way is not None]
    if not is_enough and len(slow) < len(found):
        return None
    return max(slow, key=lambda way: way.seconds, default=None)


def _way_into(case: Case, name: str, state: str, limit: float) -> Way | None:
    """Return a vehicle's quickest path into a state, if it takes longer than `limit`."""
    vehicle = case.plan.fleet[name]
    is_misled = any(fault.vehicle == name and misleads(fault) for fault in case.plan.faults)
    known = _left_alone if is_misled or vehicle.goal(state) not in vehicle.states else _unasked
    if vehicle not in case.cached(known) or no_way_exceeds(case, vehicle, limit):
        return None
    way = quickest_into(ways_from(case, vehicle, [_first(vehicle)]), state)
    return way if way is not None and exceeds(way.seconds, limit) else None


def _way_to_rest(case: Case, vehicle: VehiclePlan, limit: float) -> Way | None:
    """Return a vehicle's quickest path to its final rest, if it takes longer than `limit`."""
    if no_way_exceeds(case, vehicle, limit):
        return None
    ways = ways_from(case, vehicle, [_first(vehicle)])
    going_on = {name for name, state in vehicle.states.items() if state.transitions}
    rests = (w for n, w in ways.items() if n.flight is GROUND and n.state not in going_on)
    way = min(rests, key=lambda way: way.seconds, default=None)
    return way if way is not None and exceeds(way.seconds, limit) else None


def _first(vehicle: VehiclePlan) -> FlightNode:
    return FlightNode(vehicle.begin, GROUND)


def _unasked(case: Case) -> Iterator[VehiclePlan]:
    """Yield the vehicles that follow only their own transitions: no flow or callback requests a
    state from them."""
    vehicles = () if case.cached(disturbances) else case.plan.vehicles
    return (vehicle for vehicle in vehicles if not vehicle.requested)


def _left_alone(case: Case) -> Iterator[VehiclePlan]:
    """Yield the vehicles that follow only their own transitions and that no fault affects. A
    vehicle with a fault counts if the mission expects it to end in `landed`: then the failsafe must
    not end its flight in `fault`."""
    broken = {fault.vehicle for fault in case.plan.faults}
    for _, expression in case.expected() if broken else ():
        match expression:
            case tree.Finally(tree.InState(name, "landed")):
                broken.discard(name)
            case tree.Finally(tree.GroupInState("all", _, names, "landed")):
                broken -= set(names)
    yield from (v for v in case.cached(_unasked) if v.name not in broken)


def _place(case: Case, vehicle: VehiclePlan, way: Way) -> Span:
    """Return where the duration of the longest state on a path is written."""
    name = way.longest()
    state = vehicle.states.get(name)
    if state is None:
        return vehicle.span
    waits = [t for t in state.transitions if t.cause != "then" and t.after is not None]
    if name in endless_states(vehicle) and waits:
        return waits[0].span
    return blamed(case, vehicle, state)
