"""Checks for requests of callbacks that can't be met when they come, or that defeat their purpose:
KYB450 to KYB452 and KYB555."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.actions import actions_of
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.events import LANDED, known_events
from kybflow.dsl.checks.reachability import PHRASES
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.plan import ActionKeys, CallbackPlan, VehiclePlan
from kybflow.parts import AIR, GROUND, MOVING, Flight

_STARTED, _ENDED, _TOOK_OFF = "behavior_started", "behavior_ended", "took_off"
_AFTER = {LANDED: (GROUND, MOVING), _TOOK_OFF: (AIR, MOVING)}
"""The flight conditions possible after an event, when the next behavior may already have begun."""
_BEFORE_ALL = frozenset({"run_started", "preflight_passed", _TOOK_OFF})
"""Events that occur before anything has been flown."""


def always_refused(case: Case) -> Iterator[Diagnostic]:
    """KYB450: a callback requests a state that its vehicle can't enter when the event occurs, so
    the request is always refused.

    The vehicle's flight condition is known when one of its behaviors has just begun, and after a
    take-off or a landing. An interrupted take-off or landing leaves the vehicle moving, which only
    landings and `brake` accept.
    """
    for callback, action, vehicle in case.cached(_switched):
        flights = _flights_at(case, callback, vehicle)
        goal = vehicle.goal(action.value.state)
        legs = case.legs(vehicle, goal)
        if flights and legs and not any(case.accepts(vehicle, goal, f) for f in flights):
            starts = " or ".join(dict.fromkeys(PHRASES[leg.start] for leg in legs))
            yield Diagnostic(
                "KYB450",
                f"`{action.value.state}` can't be entered at this event",
                action.value.span,
                label=f"starts {starts}",
                notes=(f"`{vehicle.name}` is {PHRASES[flights[0]]} then",),
                help="request a state that starts there, or use another event",
            )


def never_goes_on(case: Case) -> Iterator[Diagnostic]:
    """KYB451: a callback requests a state again whenever it ends, so whatever follows it is never
    flown (a warning)."""
    for callback, action, vehicle in case.cached(_switched):
        state = _behavior(callback)
        is_whenever = callback.when is None and len(callback.fields) == 1
        if _bare(callback) != _ENDED or not is_whenever:
            continue
        if state in vehicle.states and vehicle.goal(action.value.state) == state:
            yield Diagnostic(
                "KYB451",
                f"nothing that follows `{state}` is ever flown",
                action.value.span,
                label="restarts whenever it ends",
                help="request another state, or add a `when` that becomes false",
                severity=Severity.WARNING,
            )


def stopped_at_the_beginning(case: Case) -> Iterator[Diagnostic]:
    """KYB452: a callback stops the run before anything is flown: at its beginning or at a take-off
    (a warning)."""
    for callback in case.plan.callbacks:
        if not callback.event or callback.when is not None or callback.fields:
            continue
        stops = [action for action in callback.do if action.name == "stop"]
        if stops and _bare(callback) in _BEFORE_ALL:
            yield Diagnostic(
                "KYB452",
                f"`stop` at `{callback.event}` ends the mission before anything is flown",
                stops[0].span,
                label="lands all vehicles at once",
                help="stop at a later event, or add a `when`",
                severity=Severity.WARNING,
            )


def switched_in_vain(case: Case) -> Iterator[Diagnostic]:
    """KYB555: a callback switches a processor on that nothing switches off, or switches one off as
    soon as the vehicle flies, and nothing switches it on (a warning)."""
    on, off = ({*_processors(case, name)} for name in ("enable", "disable"))
    for callback in case.plan.callbacks if on or off else ():
        is_at_once = callback.when is None and not callback.fields
        for action in callback.do:
            if action.name == "enable" and off.isdisjoint(_named(case, action)):
                what, hint = "is never off", "remove this, or add the `disable` that it undoes"
            elif (
                action.name == "disable"
                and is_at_once
                and _bare(callback) in _BEFORE_ALL
                and on.isdisjoint(_named(case, action))
            ):
                what, hint = "is off for the whole flight", "remove it from `processors` instead"
            else:
                continue
            name = action.value_text
            yield Diagnostic(
                "KYB555",
                f"`{name.text}` {what}",
                name.span,
                help=hint,
                severity=Severity.WARNING,
            )


def _processors(case: Case, action: str) -> Iterator[tuple[str, str]]:
    for one in actions_of(case, action):
        yield from _named(case, one)


def _named(case: Case, action: ActionKeys) -> Iterator[tuple[str, str]]:
    """Yield (vehicle, processor) for each processor that an `enable` or a `disable` names."""
    who, _, label = action.value_text.text.partition(".")
    yield from ((vehicle, label) for vehicle in case.plan.members(who))


def _switched(case: Case) -> Iterator[tuple[CallbackPlan, ActionKeys, VehiclePlan]]:
    """Yield every `switch` of a callback whose target is the vehicle that raises the event."""
    plan, events = case.plan, next(iter(case.cached(known_events)))
    for callback in plan.callbacks:
        asked = [action for action in callback.do if action.name == "switch"]
        if not callback.event or not asked:
            continue
        heard = events.sources(callback.event)
        for action in asked:
            assert action.target is not None
            if heard == plan.members(action.target) and len(heard) == 1:
                yield callback, action, plan.fleet[heard[0]]


def _bare(callback: CallbackPlan) -> str:
    return callback.event.rpartition(".")[2]


def _behavior(callback: CallbackPlan) -> str:
    """Return the behavior for which the callback filters; empty if there is none."""
    return dict(callback.fields).get("behavior", "")


def _flights_at(case: Case, callback: CallbackPlan, vehicle: VehiclePlan) -> tuple[Flight, ...]:
    """Return the possible flight conditions of the vehicle at the callback's event; empty if
    unknown."""
    event, state = _bare(callback), _behavior(callback)
    if event == _STARTED:
        legs = case.legs(vehicle, state)
        return tuple(leg.end if leg.start is leg.end else MOVING for leg in legs)
    return _AFTER.get(event, ())
