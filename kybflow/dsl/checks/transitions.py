"""Transitions of behaviors and phases: their targets, the flight types that must match, transitions
that can never be taken, and reserved names: KYB201 to KYB204, KYB206, KYB207 and KYB241."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from kybflow.dsl.checks.case import TARGETS, WORDS, Case, no_state, part_of, wrong_goal
from kybflow.dsl.checks.flows import all_known, phases
from kybflow.dsl.checks.reachability import PHRASES, FlightEdge, endless_states, flight_graph
from kybflow.dsl.diagnostics import Diagnostic, Related, Span, Text
from kybflow.dsl.expanding.flows import GROUNDED
from kybflow.dsl.expressions import Condition
from kybflow.dsl.expressions.reasoning import implies
from kybflow.dsl.language.records import layout_of
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import PhasePlan, StatePlan, TargetKeys, TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND, MOVING, Leg
from kybflow.parts.observables import chains_of


def unknown_targets(case: Case) -> Iterator[Diagnostic]:
    """KYB201: a transition, or `begin`, names a state that the vehicle does not have.

    A target is one of the vehicle's own behaviors or one of the built-in states `landed`, `brake`,
    `hover`, `auto_land` and `land_blind`. Only the failsafe enters `fault`.
    """
    for vehicle in case.plan.vehicles:
        if vehicle.begin not in (*vehicle.states, GROUNDED):
            yield no_state("KYB201", Text(vehicle.begin, _begins_at(vehicle)), vehicle)
        for state in vehicle.states.values():
            for transition in state.transitions:
                if vehicle.goal(transition.target) not in vehicle.states:
                    goal = Text(transition.target, transition.target_span)
                    finding = wrong_goal("KYB201", goal, vehicle)
                    if finding is not None:
                        yield finding


def begins_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB202: the first behavior of a vehicle does not start on the ground, where every run
    begins."""
    for vehicle in case.plan.vehicles:
        begin = vehicle.begin
        state = vehicle.states.get(begin)
        if state is None or case.accepts(vehicle, begin, GROUND):
            continue
        grounded = [s for s in vehicle.states if case.legs(vehicle, s)[0].start is GROUND]
        yield Diagnostic(
            "KYB202",
            f"`{state.name}` can't be the first behavior of `{vehicle.name}`",
            _begins_at(vehicle),
            label=f"starts {_starts(state.legs)}",
            notes=("a run begins on the ground",),
            help=f"did you mean `begin: {grounded[0]}`?" if grounded else "begin with a take-off",
        )


def _begins_at(vehicle: VehiclePlan) -> Span:
    """Return where the first behavior is named: under `begin`, or else where it is declared."""
    begin = vehicle.text_of("begin")
    return vehicle.states[vehicle.begin].span if begin is None else begin.span


def ends_that_do_not_meet(case: Case) -> Iterator[Diagnostic]:
    """KYB203: a behavior can't follow another one, because it can't start in the condition in which
    the other leaves the vehicle.

    Each behavior has a flight type, such as ground to air. Its normal end (`then`) completes the
    flight type. `next`, `failed` and `within` interrupt a take-off or a landing and leave the
    vehicle moving, which `brake`, `land` and `land_blind` accept.
    """
    for vehicle in case.plan.vehicles:
        for link in flight_graph(case, vehicle).broken:
            source, target = vehicle.states[link.source.state], link.transition.target
            own, part = source.behavior.name, part_of(vehicle, target)
            starts = _starts(case.legs(vehicle, target))
            early = ", left before its end," if link.flight is MOVING else ""
            yield Diagnostic(
                "KYB203",
                f"`{target}` can't follow `{source.name}`",
                link.transition.target_span,
                label=f"needs a vehicle {starts}",
                notes=(
                    f"`{source.name}` ({own}){early} leaves the vehicle {PHRASES[link.flight]}; "
                    f"`{target}` ({part}) starts {starts}",
                ),
                help=_alternative(case, vehicle, link),
            )


def _alternative(case: Case, vehicle: VehiclePlan, link: FlightEdge) -> str:
    """Return the help line with the next behavior in the file that could follow, or else with a
    built-in state that could; empty if there is none."""
    names = list(vehicle.states)
    behind = names[names.index(link.source.state) + 1 :] + names
    own = [n for n in behind if n != link.source.state]
    for name in [*own, *TARGETS]:
        if case.accepts(vehicle, name, link.flight):
            return f"did you mean `{name}`?"
    return ""


def _starts(legs: tuple[Leg, ...]) -> str:
    return " or ".join(dict.fromkeys(PHRASES[leg.start] for leg in legs))


def unreachable_states(case: Case) -> Iterator[Diagnostic]:
    """KYB204: no transition, callback or flow leads to a behavior, so it can never be flown.

    Behaviors inherited through `like` are exempt: a template may offer more than one mission uses.
    Missions with a transition to an unknown name are checked once that is corrected. Of behaviors
    that lead to each other, only the first is reported.
    """
    for vehicle in case.plan.vehicles if all_known(case.plan) else ():
        reached = reached_states(vehicle)
        if not reached <= {*vehicle.states, *TARGETS}:
            continue
        led_to = set[str]()
        for state in vehicle.states.values():
            if state.name in reached or state.inherited or state.name in led_to:
                continue
            led_to |= reached_states(vehicle, (state.name,))
            name, span = _unreached(vehicle, state, reached)
            is_own = vehicle.is_written("begin")
            begins = (Related(vehicle.key_span("begin"), "the first state"),) if is_own else ()
            if vehicle.goal(name) != state.name:
                continue  # reported for the chain's first state
            yield Diagnostic(
                "KYB204",
                f"`{name}` is never reached",
                span,
                label="no transition leads here",
                notes=tuple(_open_ends(vehicle, reached)),
                help=_way_in(case, vehicle, name),
                related=begins,
            )


def _way_in(case: Case, vehicle: VehiclePlan, name: str) -> str:
    """Return the help line for a behavior that is never reached. If only other vehicles that share
    the behavior reach it, it should be written only for those."""
    own = vehicle.states.get(vehicle.goal(name))
    needing = [
        f"`{other.name}`"
        for other in case.plan.vehicles
        if own is not None
        and (state := other.states.get(own.name)) is not None
        and state.span == own.span
        and own.name in reached_states(other)
    ]
    if needing:
        return f"write it only in {' and '.join(needing)}, which reaches it"
    if case.plan.flows:
        a_flow = f"let a flow run it (`run: {{{vehicle.name}: {name}}}`)"
        return f"let a behavior lead to it (`then: {name}`), {a_flow}, or remove it"
    return f"let another behavior lead to it (`then: {name}`), or remove it"


def _unreached(
    vehicle: VehiclePlan, state: StatePlan, reached: AbstractSet[str]
) -> tuple[str, Span]:
    """Return (name, span) to report: the outermost chain whose first state is not reached, or else
    the state."""
    name, span = state.name, state.span
    for chain, use in zip(chains_of(name), span.used, strict=False):
        if vehicle.goal(chain) not in reached:
            return chain, use
    return name, span


def _open_ends(vehicle: VehiclePlan, reached: AbstractSet[str]) -> Iterator[str]:
    """Yield a note for each of the vehicle's own behaviors that is reached but doesn't say what
    follows."""
    for state in vehicle.states.values():
        is_own = not state.inherited and not any(chains_of(state.name))
        is_open = all(t.cause in {"within", "failed"} for t in state.transitions)
        if not (state.name in reached and is_own and is_open):
            continue
        if any(leg.end is AIR for leg in state.legs):
            yield f"`{state.name}` has no `then` ({state.span.at})"


def reached_states(vehicle: VehiclePlan, since: tuple[str, ...] = ()) -> set[str]:
    """Return the states that are reached from those in `since`, by default from the first state and
    from those that may be requested. Names that the vehicle does not have are included."""
    waiting = list(since or (vehicle.begin, *vehicle.requested))
    reached = set(waiting)
    while waiting:
        state = vehicle.states.get(waiting.pop())
        for transition in state.transitions if state else ():
            if transition.target not in reached:
                reached.add(transition.target)
                waiting.append(transition.target)
    return reached


_MARKS = frozenset({"*", "="})  # `transitions` reads them as any state and as the same state


@dataclass(frozen=True, slots=True)
class _Guarded:
    """A transition with its parsed condition. when: None if it has no condition or one with
    errors."""

    transition: TransitionPlan
    when: Condition | None

    @property
    def understood(self) -> bool:
        return self.transition.when is None or self.when is not None


def never_fires(case: Case) -> Iterator[Diagnostic]:
    """KYB206: a transition can never be taken, because an earlier one is always taken first, or
    because it waits for the end of a behavior that never ends.

    Each tick evaluates the `next` list from the top, then the end of the behavior, then `within`. A
    transition that waits only for time leaves the state at that time, so anything later never
    happens.
    """
    for vehicle in case.plan.vehicles:
        for state in (vehicle.states[name] for name in sorted(endless_states(vehicle))):
            for way in (t for t in state.transitions if t.cause == "then" and not t.since):
                yield Diagnostic(
                    "KYB206",
                    f"this transition of `{state.name}` is never taken",
                    way.target_span,
                    label=f"`{state.behavior.name}` never ends by itself",
                    help="leave it with `next` or `within`, or set its duration if it has one",
                )
    for vehicle, state in case.states():
        scope = case.scopes.condition(vehicle.name)
        timed = [t for t in state.transitions if t.cause in ("next", "within")]
        timed.sort(key=lambda t: t.cause == "within")
        guarded = [_Guarded(t, case.condition(t, "when", scope)) for t in timed]
        for index, later in enumerate(guarded):
            others = [a for a in guarded if _can_shadow(a, later, vehicle, state)]
            before = [a for a in guarded[:index] if a in others and _covers(a, later)]
            before += [a for a in others if _is_sooner(a, later)]
            if before:
                yield _shadowed("KYB206", state, later.transition, before[0].transition)


def phases_never_left(case: Case) -> Iterator[Diagnostic]:
    """KYB241: a transition of a phase can never be taken, because another one is always taken
    first."""
    scope = case.scopes.flow()
    told: set[Span] = set()
    for _, phase in phases(case.plan):
        guarded = [_Guarded(t, case.condition(t, "when", scope)) for t in phase.transitions]
        for index, later in enumerate(guarded):
            before = [a for a in guarded[:index] if _covers(a, later)]
            before += [a for a in guarded if _is_sooner(a, later)]
            if before and later.transition.span not in told:
                told.add(later.transition.span)
                yield _shadowed("KYB241", phase, later.transition, before[0].transition)


def _can_shadow(first: _Guarded, later: _Guarded, vehicle: VehiclePlan, state: StatePlan) -> bool:
    """Return whether `later`, a transition of `state`, is reported if `first` is always taken
    before it.

    Every state of a chain has the transitions of the whole chain. They are only compared with each
    other, and reported once, at the chain's first state.
    """
    chain = later.transition.since
    if not chain:
        return True
    return first.transition.since == chain and vehicle.goal(chain) == state.name


def _covers(first: _Guarded, later: _Guarded) -> bool:
    """Return whether `first` is taken in every tick in which `later` would be."""
    a, b = first.transition, later.transition
    if not first.understood or not later.understood or _is_empty(a) or _is_empty(b):
        return False
    if a.event is not None and a.event != b.event:
        return False
    if a.after is not None and (b.after is None or b.after < a.after):
        return False
    if first.when is None:
        return True
    return later.when is not None and b.hold >= a.hold and implies(later.when, first.when)


def _is_sooner(first: _Guarded, later: _Guarded) -> bool:
    """Return whether `first` waits only for time, and for less time than `later`."""
    a, b = first.transition, later.transition
    if a.after is None or a.when is not None or a.event is not None or b.after is None:
        return False
    return a.after < b.after


def _is_empty(transition: TransitionPlan) -> bool:
    return transition.when is None and transition.event is None and transition.after is None


def _shadowed(
    code: str, state: StatePlan | PhasePlan, later: TransitionPlan, first: TransitionPlan
) -> Diagnostic:
    sooner = f"{first.span.beside(later.span)} goes to `{first.target}`"
    brought = isinstance(state, PhasePlan) and later.cause == "within" and later.span.used
    way_out = "put the more specific one first, or remove it"
    return Diagnostic(
        code,
        f"this transition of `{later.since or state.name}` is never taken",
        later.span,
        label=f"the one to `{first.target}` is always taken first",
        notes=(f"{sooner} whenever this one could be taken",),
        help="write `within: null, otherwise: null` to remove it" if brought else way_out,
    )


def reserved_names(case: Case) -> Iterator[Diagnostic]:
    """KYB207: a vehicle or a behavior has a name that the language reserves.

    Reserved are the built-in states (landed, brake, hover, auto_land, land_blind, fault), the words
    of conditions and events (and, or, not, in, to, within, always, eventually, finally, all, any,
    start, operator, world), `*` and `=`; for a vehicle also `inputs`, a key of the targets.
    """
    for vehicle in case.plan.vehicles:
        if vehicle.name in WORDS | _MARKS:
            yield _reserved(vehicle, "vehicle", "a reserved word")
        elif vehicle.name in layout_of(TargetKeys).own:
            yield _reserved(vehicle, "vehicle", "a key of `targets`")
        for state in vehicle.states.values():
            if state.name in BUILT_IN:
                yield _reserved(state, "behavior", "a built-in state")
            elif state.name in WORDS | _MARKS:
                yield _reserved(state, "behavior", "a reserved word")


def _reserved(named: VehiclePlan | StatePlan, what: str, why: str) -> Diagnostic:
    name = named.name
    return Diagnostic(
        "KYB207",
        f"a {what} can't be called `{name}`",
        named.span,
        label=why,
        help=f"give it another name, such as `my_{name}`" if name.isalpha() else "",
    )
