"""Events: which of them a mission can hear, and those that transitions and callbacks wait for in
vain: KYB208, KYB209, KYB415 and KYB449."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

from kybflow.core.events import AlarmRaised, BaseEvent
from kybflow.core.signals import Frame, Pose
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.contexts import contexts
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.language.source import Record
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import Plan, StatePlan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.parts.events import AWAITED_EVENTS, RUN_EVENTS, VEHICLE_EVENTS, Landed


def unknown_events(case: Case) -> Iterator[Diagnostic]:
    """KYB208: a transition or a callback waits for an event that nothing here emits, or that no
    tick follows, so that nothing ever comes of it.

    Known are the engine's events, those that the vehicles' parts declare, those that the mission's
    own actions emit, and `operator.NAME`, which a person gives. A transition hears its own
    vehicle's and the run's as `NAME`; everybody hears `VEHICLE.NAME` and `any.NAME`; a callback
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
    """The event that each transition or callback waits for, where it does."""
    return (event for one in records if (event := one.text_of("event")) is not None)


def _unheard(event: Text, known: KnownEvents, own: str | None, groups: Iterable[str]) -> Diagnostic:
    hint, notes = did_you_mean(event.text, known.names(own, groups)), list[str]()
    if "." not in event.text and any(event.text in events for events in known.of.values()):
        hint = f"it is a vehicle's: write `{ANY}.{event.text}` or `VEHICLE.{event.text}`"
    elif not hint.startswith("did"):
        notes = [_of_a_person(event.text.rpartition(".")[2])]
    message = f"nothing here tells the event `{event.text}`"
    return Diagnostic("KYB208", message, event.span, "never heard", tuple(notes), hint)


def _of_a_person(name: str) -> str:
    """A note that says how an operator or a callback can give an event that no part emits."""
    given = f"{OPERATOR}{name}"
    return f"a person gives `{given}`: `run --emit {given}@2s`; a callback gives `{{emit: {name}}}`"


def _too_late(event: Text, known: KnownEvents) -> Iterator[Diagnostic]:
    kind = AWAITED_EVENTS.get(event.text.rpartition(".")[2], BaseEvent)
    if kind.awaited == "too late" and event.text not in known.custom:
        message = f"nothing can follow the event `{event.text}`"
        yield Diagnostic("KYB208", message, event.span, label="the run is over then")


def never_emitted(case: Case) -> Iterator[Diagnostic]:
    """KYB415: a transition or a callback waits for an event that its vehicle can't have.

    It flies on no camera, or has no payload, or there is no fence to leave. That nobody else
    commands a vehicle, as in a simulator, is a warning, and only where the mission has no `targets`
    of its own.
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
    """The finding for an event that none of the vehicles can have of which it speaks."""
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
            f"the event `{event.text}` never comes",
            event.span,
            label=lacks[0],
            help="wait for something else, or give the vehicle what tells it",
            severity=Severity.WARNING if is_doubt else Severity.ERROR,
        )


def not_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB449: a behavior that flies from the air into the air waits for its own vehicle to have
    landed, which comes only when another behavior has brought it down."""
    for vehicle, state in case.states():
        for event in _heard(way for way in state.transitions if not way.since):
            own = {LANDED} if state.inherited else {LANDED, f"{vehicle.name}.{LANDED}"}
            if event.text in own and _stays_in_the_air(state):
                yield Diagnostic(
                    "KYB449",
                    f"`{event.text}` never comes in `{state.name}`",
                    event.span,
                    label=f"`{state.behavior.name}` stays in the air",
                    help="let it lead to a landing, and hear the event there",
                )


def _stays_in_the_air(state: StatePlan) -> bool:
    return all(leg.start is not GROUND and leg.end is AIR for leg in state.legs)


def _lacks(case: Case, name: str, event: str) -> str:
    """What a vehicle lacks to have an event; empty when it lacks nothing."""
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
            return f"nobody else commands `{name}` on `{vehicle.driver.name}`"
    return ""


def _silent(case: Case, vehicle: VehiclePlan, event: str) -> str:
    """The supervisor that alone emits an event, and has nothing to watch; empty where one does."""
    emitting = [part for part in vehicle.supervisors if event in part.cls.events]
    context = next(c for v, c in case.cached(contexts) if v is vehicle) if emitting else None
    if context is None or any(event in part.cls.can_emit(context) for part in emitting):
        return ""
    return f"`{emitting[0].alias}` has nothing to watch here"


def of_the_simulator(case: Case) -> Iterator[Diagnostic]:
    """KYB209: a mission acts on something that only the simulator knows.

    That a fault is at work no vehicle can know, and on hardware nobody tells. A mission answers
    what the vehicle notices instead: `estimate_lost`, `battery_low`, `jumped`. A callback may `log`
    it.
    """
    ways = [way for _, state in case.states() for way in state.transitions]
    phases = (phase for flow in case.plan.flows for phase in flow.phases.values())
    ways += [way for phase in phases for way in phase.transitions]
    acting = [c for c in case.plan.callbacks if any(action.name != "log" for action in c.do)]
    for event in _heard((*ways, *acting)):
        if AWAITED_EVENTS.get(event.text.rpartition(".")[2], BaseEvent).awaited == "to log it":
            message = f"only the simulator knows of `{event.text}`"
            hint = "answer what the vehicle notices, like `estimate_lost`; a callback may `log` it"
            yield Diagnostic("KYB209", message, event.span, help=hint)


ANY = "any"
LANDED = Landed.name
"""The event of a vehicle whose landing has ended."""
OPERATOR = "operator."
"""How the name of an event begins that a person gives."""


def given_by_a_person(event: str, plan: Plan) -> bool:
    """Whether a person gives an event, by command or by a button."""
    first, _, button = event.partition(".")
    use = plan.inputs_by_name.get(first)
    return event.startswith(OPERATOR) or (use is not None and button in use.button_names.values())


class KnownEvents:
    """The events of a mission. `custom` are those that its actions emit, the ends of its flows and
    the buttons of its inputs,
    `of` those of a vehicle by their bare names."""

    def __init__(self, case: Case) -> None:
        self._plan = case.plan
        self.of = {v.name: _emitted_by(v, case) for v in case.plan.vehicles}

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
        """The vehicles that an event's name speaks of: `("",)` is the run. None tells an unknown
        one."""
        first, dot, name = event.partition(".")
        if event in self.of_the_run or event.startswith(OPERATOR):
            return ("",)
        if not dot:
            return ()
        asked = tuple(self.of) if first == ANY else self._plan.members(first)
        return tuple(vehicle for vehicle in asked if name in self.of[vehicle])

    def fields_of(self, event: str) -> tuple[str, ...]:
        """The fields of an event, by its bare name. A mission's own event has none."""
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
        """Whether a transition can hear an event: of the vehicle `own`, or of a flow (None)."""
        if own is not None and event in self.of[own]:
            return True
        return event.partition(".")[0] not in self._plan.groups and bool(self.sources(event))

    def names(self, own: str | None, groups: Iterable[str]) -> set[str]:
        """Every name under which an event can be heard: by `own` also its vehicle's bare ones, and
        those of `groups`."""
        events = {event for known in self.of.values() for event in known}
        return {
            *self.of_the_run,
            *(f"{vehicle}.{event}" for vehicle, known in self.of.items() for event in known),
            *(f"{first}.{event}" for first in (ANY, *groups) for event in events),
            *self.of.get(own or "", ()),
        }


def known_events(case: Case) -> Iterator[KnownEvents]:
    """The events of a mission, for `case.cached`."""
    yield KnownEvents(case)


def emitted(plan: Plan) -> frozenset[str]:
    """The custom events that the actions and transitions of a mission emit."""
    found = {name.text for name in emitted_by_transitions(plan)}
    for callback in plan.callbacks:
        for action in callback.do:
            if action.name == "emit":
                found.add(action.value)
            elif action.part is not None:
                found.update(action.part.cls.events)
    return frozenset(found)


def emitted_by_transitions(plan: Plan) -> list[Text]:
    """The events that transitions of states and phases emit."""
    ways = [state.transitions for v in plan.vehicles for state in v.states.values()]
    ways += [phase.transitions for f in plan.flows for phase in f.phases.values()]
    told = (way.text_of("emit") for several in ways for way in several)
    return [name for name in told if name is not None and name.text]


def _emitted_by(vehicle: VehiclePlan, case: Case) -> frozenset[str]:
    """The events that belong to the vehicle, by their bare names."""
    parts = [*vehicle.processors, *vehicle.supervisors, vehicle.tracker, vehicle.driver]
    parts += [estimator.part for estimator in vehicle.estimators]
    parts += [state.behavior for state in vehicle.states.values()]
    classes = [part.cls for part in parts]
    classes += [case.catalog.get("behaviors", name).cls for name in BUILT_IN.values()]
    return VEHICLE_EVENTS.union(*(cls.events for cls in classes))
