"""Names and flight types of the arrows between states: KYB201 to KYB204."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from kybflow.dsl.checks.case import TARGETS, Case, part_of
from kybflow.dsl.checks.flights import PHRASES, Link, flights_of
from kybflow.dsl.checks.goals import no_state, wrong_goal
from kybflow.dsl.checks.phases import all_known
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import State, Vehicle
from kybflow.dsl.reading.source import Span
from kybflow.dsl.shaping.flows import GROUNDED
from kybflow.parts import GROUND, MOVING, Leg
from kybflow.parts.observables import chains_of


def unknown_targets(case: Case) -> Iterator[Diagnostic]:
    """KYB201: an arrow, or `begin`, names a state that the vehicle does not have.

    A target is one of the vehicle's own behaviors or one of the built-in states `landed`, `brake`,
    `hover`, `auto_land` and `land_blind`. `fault` is entered by the failsafe alone.
    """
    for vehicle in case.vehicles():
        if vehicle.begin.text not in (*vehicle.states, GROUNDED):
            yield no_state("KYB201", vehicle.begin, vehicle)
        for state in vehicle.states.values():
            for arrow in state.transitions:
                finding = wrong_goal("KYB201", arrow.target, vehicle)
                if finding is not None:
                    yield finding


def begins_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB202: the first behavior of a vehicle does not start on the ground, where every run
    begins."""
    for vehicle in case.vehicles():
        begin = vehicle.begin.text
        state = vehicle.states.get(begin)
        if state is None or case.accepts(vehicle, begin, GROUND):
            continue
        grounded = [s for s in vehicle.states if case.legs(vehicle, s)[0].start is GROUND]
        yield Diagnostic(
            "KYB202",
            f"`{state.name.text}` can't be the first behavior of `{vehicle.name.text}`",
            vehicle.begin.span,
            label=f"starts {_starts(state.part.spec.cls.flight)}",
            notes=("a run begins on the ground",),
            help=f"did you mean `begin: {grounded[0]}`?" if grounded else "begin with a take-off",
        )


def ends_that_do_not_meet(case: Case) -> Iterator[Diagnostic]:
    """KYB203: a behavior can't follow another: where one leaves the vehicle, the other can't start.

    Each behavior has flight types, such as ground to air. Its normal end (`then`) reaches the far
    side; `next`, `failed` and `within` leave a take-off or a landing before its end, and the
    vehicle is then moving, which `brake`, `land` and `land_blind` accept.
    """
    for vehicle in case.vehicles():
        for link in flights_of(case, vehicle).broken:
            yield _broken(case, vehicle, link)


def _broken(case: Case, vehicle: Vehicle, link: Link) -> Diagnostic:
    source = vehicle.states[link.source.state]
    target = link.transition.target.text
    legs = case.legs(vehicle, target)
    own, part = source.part.name.text, part_of(vehicle, target)
    early = ", left before its end," if link.flight is MOVING else ""
    return Diagnostic(
        "KYB203",
        f"`{target}` can't follow `{source.name.text}`",
        link.transition.target.span,
        label=f"needs a vehicle {_starts(legs)}",
        notes=(
            f"`{source.name.text}` ({own}){early} leaves the vehicle {PHRASES[link.flight]}; "
            f"`{target}` ({part}) starts {_starts(legs)}",
        ),
        help=_alternative(case, vehicle, link),
    )


def _alternative(case: Case, vehicle: Vehicle, link: Link) -> str:
    """The next behavior written after the source that fits; else a built-in state that does."""
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
    """KYB204: no arrow, callback or flow leads to a behavior, so it can never be flown.

    Behaviors that came through `like` are excepted: a template may offer more than one mission
    uses. Where an arrow leads to an unknown name, nothing is said before that is mended.
    """
    for vehicle in case.vehicles() if all_known(case.document) else ():
        reached = reached_states(vehicle)
        if not reached <= {*vehicle.states, *TARGETS}:
            continue
        for state in vehicle.states.values():
            if state.name.text in reached or state.inherited:
                continue
            name, span = _unreached(vehicle, state, reached)
            if vehicle.goal(name) != state.name.text:
                continue  # told for the chain's first state
            yield Diagnostic(
                "KYB204",
                f"`{name}` is never reached",
                span,
                label="no arrow leads here",
                help=f"let another behavior go there, as `then: {name}`, or remove it",
            )


def _unreached(vehicle: Vehicle, state: State, reached: AbstractSet[str]) -> tuple[str, Span]:
    """What is not reached, and where: the outermost chain whose first state is not, else the
    state."""
    name, span = state.name.text, state.name.span
    for chain, use in zip(chains_of(name), span.used, strict=False):
        if vehicle.goal(chain) not in reached:
            return chain, use
    return name, span


def reached_states(vehicle: Vehicle) -> set[str]:
    """The states that an arrow leads to, or that something may ask for; unknown names too."""
    waiting, reached = [vehicle.begin.text, *vehicle.asked], {vehicle.begin.text, *vehicle.asked}
    while waiting:
        state = vehicle.states.get(waiting.pop())
        for transition in state.transitions if state else ():
            if transition.target.text not in reached:
                reached.add(transition.target.text)
                waiting.append(transition.target.text)
    return reached
