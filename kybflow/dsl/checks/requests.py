"""What callbacks ask at a moment at which it can't be done, or ends what it should serve: KYB450 to
KYB452."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.events import LANDED, KnownEvents, known_events
from kybflow.dsl.checks.reachability import PHRASES
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.plan import ActionKeys, CallbackPlan, VehiclePlan
from kybflow.parts import AIR, GROUND, MOVING, Flight

_STARTED, _ENDED, _TOOK_OFF = "behavior_started", "behavior_ended", "took_off"
_AFTER = {LANDED: (GROUND, MOVING), _TOOK_OFF: (AIR, MOVING)}
"""How a vehicle may be found when an event is heard: its next behavior has begun."""
_BEFORE_ALL = frozenset({"run_started", "preflight_passed", _TOOK_OFF})
"""Events before anything of a mission is flown."""


def always_refused(case: Case) -> Iterator[Diagnostic]:
    """KYB450: a callback asks for a state that its vehicle can't enter when the event is heard, so
    that the request is always refused.

    Known is where a vehicle is when one of its behaviors has begun, and when it has taken off or
    landed: a take-off or a landing that is broken off leaves it moving, which only a landing and
    `brake` accept.
    """
    for callback, action, vehicle in case.cached(_switched):
        flights = _found(case, callback, vehicle)
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
                help="ask for a state that fits, or at another event",
            )


def never_goes_on(case: Case) -> Iterator[Diagnostic]:
    """KYB451: a callback asks for a state again whenever it has ended, so that nothing that follows
    it is ever flown (a warning)."""
    for callback, action, vehicle in case.cached(_switched):
        state = _behavior(callback)
        is_whenever = callback.when is None and len(callback.fields) == 1
        if _bare(callback) != _ENDED or not is_whenever:
            continue
        if state in vehicle.states and vehicle.goal(action.value.state) == state:
            yield Diagnostic(
                "KYB451",
                f"`{state}` never comes to what follows it",
                action.value.span,
                label="begins again whenever it has ended",
                help="ask for another state, or add a `when` that ends it",
                severity=Severity.WARNING,
            )


def stopped_at_the_beginning(case: Case) -> Iterator[Diagnostic]:
    """KYB452: a callback stops the run before anything of the mission is flown: at its begin or at
    a take-off (a warning)."""
    for callback in case.plan.callbacks:
        if not callback.event or callback.when is not None or callback.fields:
            continue
        stops = [action for action in callback.do if action.name == "stop"]
        if stops and _bare(callback) in _BEFORE_ALL:
            yield Diagnostic(
                "KYB452",
                f"`stop` at `{callback.event}` leaves nothing to fly",
                stops[0].span,
                label="lands everybody at once",
                help="stop at a later event, or add a `when`",
                severity=Severity.WARNING,
            )


def _switched(case: Case) -> Iterator[tuple[CallbackPlan, ActionKeys, VehiclePlan]]:
    """Every request of a callback that hears the very vehicle that it asks."""
    plan = case.plan
    for callback in plan.callbacks:
        asked = [action for action in callback.do if action.name == "switch"]
        if not callback.event or not asked:
            continue
        heard = _heard(case, callback)
        for action in asked:
            assert action.target is not None
            if heard == plan.members(action.target) and len(heard) == 1:
                yield callback, action, plan.fleet[heard[0]]


def _heard(case: Case, callback: CallbackPlan) -> tuple[str, ...]:
    events: KnownEvents
    (events,) = case.cached(known_events)
    return events.sources(callback.event)


def _bare(callback: CallbackPlan) -> str:
    return callback.event.rpartition(".")[2]


def _behavior(callback: CallbackPlan) -> str:
    """The behavior of which alone the callback hears; empty where it hears of several."""
    return dict(callback.fields).get("behavior", "")


def _found(case: Case, callback: CallbackPlan, vehicle: VehiclePlan) -> tuple[Flight, ...]:
    """How the vehicle may be found at the callback's event; empty where that is not known."""
    event, state = _bare(callback), _behavior(callback)
    if event == _STARTED:
        legs = case.legs(vehicle, state)
        return tuple(leg.end if leg.start is leg.end else MOVING for leg in legs)
    return _AFTER.get(event, ())
