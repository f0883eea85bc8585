"""The events that a mission can wait for. Checks for waits in vain: KYB208, KYB209, KYB415 and
KYB449."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

from kybflow.core.events import AlarmRaised, BaseEvent
from kybflow.core.signals import Frame, Pose
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case, contexts, transitions_of
from kybflow.dsl.diagnostics import Diagnostic, Severity, Text
from kybflow.dsl.language.records import Record
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.parts.events import AWAITED_EVENTS, RUN_EVENTS, VEHICLE_EVENTS, Landed


def unknown_events(case: Case) -> Iterator[Diagnostic]:
    """KYB208: a transition or a callback waits for an event that nothing emits, or that comes too
    late to act on.

    The known events are those of the engine, of the vehicles' parts and of the mission's own
    actions, and `operator.NAME`, which a person gives. A transition may write an event of its own
    vehicle or of the run as `NAME`; any other is `VEHICLE.NAME` or `any.NAME`, and in a callback
    also `GROUP.NAME`.
    """
    (known,) = case.cached(known_events)
    for vehicle, state in case.states():
        yield from _unheard_by(state.transitions, known, vehicle.name)
    for flow in case.plan.flows:
        for phase in flow.phases.values():
            yield from _unheard_by(phase.transitions, known, None)
    for event in _heard(case.plan.callbacks):
        if known.sources(event.text):
            yield from _too_late(event, known)
        else:
            yield _unheard(event, known, None, case.plan.groups)


def _unheard_by(
    ways: Iterable[Record], known: KnownEvents, own: str | None
) -> Iterator[Diagnostic]:
    for event in _heard(ways):
        if known.hears(event.text, own):
            yield from _too_late(event, known)
        else:
            yield _unheard(event, known, own, ())


def _heard(records: Iterable[Record]) -> Iterator[Text]:
    """Yield the event of each transition or callback that waits for one."""
    return (event for one in records if (event := one.text_of("event")) is not None)


def _unheard(event: Text, known: KnownEvents, own: str | None, groups: Iterable[str]) -> Diagnostic:
    hint, notes = did_you_mean(event.text, known.names(own, groups)), tuple[str, ...]()
    if "." not in event.text and any(event.text in events for events in known.of.values()):
        hint = f"it is an event of a vehicle: write `{ANY}.{event.text}` or `VEHICLE.{event.text}`"
    elif not hint.startswith("did"):
        name = event.text.rpartition(".")[2]
        given = f"{OPERATOR}{name}"
        notes = (f"a person's event is called `{given}` (test it with `--emit {given}@2s`)",)
        hint = f"write `event: {given}`, or emit `{name}` in a callback: `{{emit: {name}}}`"
    message = f"nothing emits the event `{event.text}`"
    return Diagnostic("KYB208", message, event.span, "never occurs", notes, hint)


def _too_late(event: Text, known: KnownEvents) -> Iterator[Diagnostic]:
    kind = AWAITED_EVENTS.get(event.text.rpartition(".")[2], BaseEvent)
    if kind.awaited == "too late" and event.text not in known.custom:
        message = f"nothing can react to the event `{event.text}`"
        hint = "wait for an earlier event, or check the end of the run in `expect:`"
        yield Diagnostic("KYB208", message, event.span, "the run has ended by then", help=hint)


def never_emitted(case: Case) -> Iterator[Diagnostic]:
    """KYB415: a transition or a callback waits for an event that its vehicle can't have.

    For example, the vehicle has no camera or no payload, or there is no fence. A vehicle that
    no pilot can command, such as one in a simulator, gets a warning, and only if the mission has no
    `targets` of its own.
    """
    (known,) = case.cached(known_events)
    for vehicle, state in case.states():
        if not state.inherited:
            for event in _heard(state.transitions):
                yield from _vain(case, known, event, vehicle.name)
    phases = (phase for flow in case.plan.flows for phase in flow.phases.values())
    ways = (way for phase in phases for way in phase.transitions)
    for event in _heard((*ways, *case.plan.callbacks)):
        yield from _vain(case, known, event, None)


def _vain(case: Case, known: KnownEvents, event: Text, own: str | None) -> Iterator[Diagnostic]:
    """Yield a finding for an event that none of the vehicles it refers to can have."""
    name, vehicles = event.text.rpartition(".")[2], known.sources(event.text)
    if own is not None and event.text in known.of[own]:
        vehicles = (own,)
    is_doubt = AWAITED_EVENTS.get(name, BaseEvent).needs == "other commanders"
    if event.text in known.of_the_run or (is_doubt and case.plan.is_written("targets")):
        return
    lacks = [_lacks(case, vehicle, name) for vehicle in vehicles if vehicle]
    if lacks and all(lacks):
        yield Diagnostic(
            "KYB415",
            f"the event `{event.text}` never occurs",
            event.span,
            label=lacks[0],
            help="wait for another event, or give the vehicle what emits it",
            severity=Severity.WARNING if is_doubt else Severity.ERROR,
        )


def not_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB449: a behavior that keeps its vehicle in the air waits for the vehicle to have landed.
    Only another behavior can land it."""
    for vehicle, state in case.states():
        if any(leg.start is GROUND or leg.end is not AIR for leg in state.legs):
            continue
        for event in _heard(way for way in state.transitions if not way.since):
            own = {LANDED} if state.inherited else {LANDED, f"{vehicle.name}.{LANDED}"}
            if event.text in own:
                yield Diagnostic(
                    "KYB449",
                    f"`{event.text}` never occurs in `{state.name}`",
                    event.span,
                    label=f"`{state.behavior.name}` stays in the air",
                    help="let it lead to a landing, and wait for the event there",
                )


def _lacks(case: Case, name: str, event: str) -> str:
    """Return in words what a vehicle lacks to have an event; empty if it lacks nothing."""
    vehicle = case.plan.fleet[name]
    if event not in AWAITED_EVENTS:
        return _silent(case, vehicle, event)
    match AWAITED_EVENTS[event].needs:
        case "a camera" | "motion capture" as what:
            parts = [estimator.part for estimator in vehicle.estimators]
            kind = Frame if what == "a camera" else Pose
            if not any(kind in part.cls.uses(part.params) for part in parts):
                return f"no estimator of `{name}` uses {what}"
        case "a payload" if vehicle.payload is None:
            return f"`{name}` carries no payload"
        case "flows" if not case.plan.flows:
            return "the mission has no flows"
        case "other commanders" if not vehicle.driver.cls.shared:
            return f"nothing else can command `{name}` on `{vehicle.driver.name}`"
    return ""


def _silent(case: Case, vehicle: VehiclePlan, event: str) -> str:
    """Return a message if an event can't occur because none of the supervisors that emit it has
    anything to watch; otherwise an empty string."""
    emitting = [part for part in vehicle.supervisors if event in part.cls.events]
    context = next(c for v, c in case.cached(contexts) if v is vehicle) if emitting else None
    if context is None or any(event in part.cls.can_emit(context) for part in emitting):
        return ""
    return f"`{emitting[0].alias}` has nothing to watch here"


def of_the_simulator(case: Case) -> Iterator[Diagnostic]:
    """KYB209: a mission acts on an event that only the simulator knows.

    On hardware nothing reports that a fault is active. A mission reacts instead to what the vehicle
    itself notices: `estimate_lost`, `battery_low`, `jumped`. A callback may `log` the event.
    """
    acting = [c for c in case.plan.callbacks if any(action.name != "log" for action in c.do)]
    for event in _heard((*transitions_of(case.plan), *acting)):
        if AWAITED_EVENTS.get(event.text.rpartition(".")[2], BaseEvent).awaited == "to log it":
            message = f"only the simulator knows about `{event.text}`"
            hint = (
                "wait for what the vehicle notices, like `estimate_lost`; a callback may `log` it"
            )
            yield Diagnostic("KYB209", message, event.span, help=hint)


ANY = "any"
LANDED = Landed.name
"""The event after a vehicle has landed."""
OPERATOR = "operator."
"""The prefix of the names of events that a person raises."""


def given_by_a_person(event: str, plan: Plan) -> bool:
    """Return whether a person raises an event, by a command or a button."""
    first, _, button = event.partition(".")
    use = plan.inputs_by_name.get(first)
    return event.startswith(OPERATOR) or (use is not None and button in use.button_names.values())


class KnownEvents:
    """The events of a mission. of: the events of each vehicle, by their bare names. custom: the
    events that its actions emit, the ends of its flows, and the buttons of its inputs."""

    def __init__(self, case: Case) -> None:
        self._plan = case.plan
        always = [case.catalog.get("behaviors", name).cls for name in BUILT_IN.values()]
        self.of = dict[str, frozenset[str]]()
        for vehicle in case.plan.vehicles:
            parts = [*vehicle.processors, *vehicle.supervisors, vehicle.tracker, vehicle.driver]
            parts += [estimator.part for estimator in vehicle.estimators]
            parts += [state.behavior for state in vehicle.states.values()]
            classes = [*always, *(part.cls for part in parts)]
            self.of[vehicle.name] = VEHICLE_EVENTS.union(*(cls.events for cls in classes))

    @cached_property
    def custom(self) -> frozenset[str]:
        plan = self._plan
        ends = {f"{flow.name}.finished" for flow in plan.flows}
        pressed = {f"{use.name}.{b}" for use in plan.inputs for b in use.button_names.values()}
        return emitted(plan) | ends | pressed

    @property
    def of_the_run(self) -> frozenset[str]:
        return RUN_EVENTS | self.custom | {f"{flow.name}.finished" for flow in self._plan.flows}

    def sources(self, event: str) -> tuple[str, ...]:
        """Return the vehicles that an event's name refers to; `("",)` stands for the run. Empty for
        an unknown event."""
        first, dot, name = event.partition(".")
        if event in self.of_the_run or event.startswith(OPERATOR):
            return ("",)
        if not dot:
            return ()
        asked = tuple(self.of) if first == ANY else self._plan.members(first)
        return tuple(vehicle for vehicle in asked if name in self.of[vehicle])

    def fields_of(self, event: str) -> tuple[str, ...]:
        """Return the fields of the event with this bare name. A mission's own event has none."""
        if event in AWAITED_EVENTS:
            return tuple(AWAITED_EVENTS[event].fields)
        for vehicle in self._plan.vehicles:
            states = (state.behavior for state in vehicle.states.values())
            for part in (*states, *vehicle.processors):
                for own in part.cls.own_events:
                    if own.name == event:
                        return tuple(own.fields)
        return tuple(AlarmRaised.fields)

    def hears(self, event: str, own: str | None) -> bool:
        """Return whether a transition of the vehicle `own`, or of a flow (None), can wait for an
        event."""
        if own is not None and event in self.of[own]:
            return True
        return event.partition(".")[0] not in self._plan.groups and bool(self.sources(event))

    def names(self, own: str | None, groups: Iterable[str]) -> set[str]:
        """Return every name under which an event can be awaited, including the bare names of the
        events of the vehicle `own`, and the events of each of `groups`."""
        events = {event for known in self.of.values() for event in known}
        return {
            *self.of_the_run,
            *(f"{vehicle}.{event}" for vehicle, known in self.of.items() for event in known),
            *(f"{first}.{event}" for first in (ANY, *groups) for event in events),
            *self.of.get(own or "", ()),
        }


def known_events(case: Case) -> Iterator[KnownEvents]:
    """Yield the events of a mission once, for use with `case.cached`."""
    yield KnownEvents(case)


def emitted(plan: Plan) -> frozenset[str]:
    """Return the custom events that the actions and transitions of a mission emit."""
    found = {name.text for name in emitted_by_transitions(plan)}
    for callback in plan.callbacks:
        for action in callback.do:
            if action.name == "emit":
                found.add(action.value)
            elif action.part is not None:
                found.update(action.part.cls.events)
    return frozenset(found)


def emitted_by_transitions(plan: Plan) -> list[Text]:
    """Return the events that transitions of states and phases emit."""
    names = (transition.text_of("emit") for transition in transitions_of(plan))
    return [name for name in names if name is not None and name.text]
