"""Names and flight types of the arrows between states: KYB201 to KYB205."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from kybflow.dsl.checks.case import NO_TARGET, TARGETS, Case, part_of
from kybflow.dsl.checks.entries import endless_states
from kybflow.dsl.checks.flights import PHRASES, Flights, Link, comes_down, flights_of
from kybflow.dsl.diagnostics import Diagnostic, did_you_mean
from kybflow.dsl.document import Transition, Vehicle
from kybflow.dsl.source import Text
from kybflow.parts import GROUND, MOVING, Leg


def unknown_targets(case: Case) -> Iterator[Diagnostic]:
    """KYB201: an arrow, or `begin`, names a state that the vehicle does not have.

    A target is one of the vehicle's own behaviors or one of the built-in states `landed`, `brake`,
    `hover`, `auto_land` and `land_blind`. `fault` is entered by the failsafe alone.
    """
    for vehicle in case.vehicles():
        known = [*vehicle.states, *TARGETS]
        if vehicle.begin.text not in vehicle.states:
            yield _unknown(vehicle.begin, vehicle, list(vehicle.states))
        arrows = (arrow for state in vehicle.states.values() for arrow in state.transitions)
        for transition in arrows:
            if transition.target.text not in known:
                yield _unknown_target(transition, vehicle, known)


def _unknown_target(transition: Transition, vehicle: Vehicle, known: list[str]) -> Diagnostic:
    if transition.target.text not in NO_TARGET:
        return _unknown(transition.target, vehicle, known)
    return Diagnostic(
        "KYB201",
        f"`{transition.target.text}` can't be chosen",
        transition.target.span,
        label="entered by the failsafe alone",
        help="use `auto_land` or `land_blind` to come down",
    )


def _unknown(name: Text, vehicle: Vehicle, known: list[str]) -> Diagnostic:
    return Diagnostic(
        "KYB201",
        f"`{vehicle.name.text}` has no behavior `{name.text}`",
        name.span,
        label="unknown",
        help=did_you_mean(name.text, known),
    )


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
    """KYB204: no arrow leads to a behavior, so it can never be flown.

    Behaviors that came through `like` are excepted: a template may offer more than one mission
    uses. Where an arrow leads to an unknown name, nothing is said before that is mended.
    """
    for vehicle in case.vehicles():
        reached = _reached(vehicle)
        if not reached <= {*vehicle.states, *TARGETS}:
            continue
        for state in vehicle.states.values():
            if state.name.text in reached or state.inherited:
                continue
            yield Diagnostic(
                "KYB204",
                f"`{state.name.text}` is never reached",
                state.name.span,
                label="no arrow leads here",
                help=f"let another behavior go there, as `then: {state.name.text}`, or remove it",
            )


def _reached(vehicle: Vehicle) -> set[str]:
    waiting, reached = [vehicle.begin.text], {vehicle.begin.text}
    while waiting:
        state = vehicle.states.get(waiting.pop())
        for transition in state.transitions if state else ():
            if transition.target.text not in reached:
                reached.add(transition.target.text)
                waiting.append(transition.target.text)
    return reached


def never_lands(case: Case) -> Iterator[Diagnostic]:
    """KYB205: from a behavior in the air no sequence of arrows reaches the ground.

    A behavior that ends and has no `then` is followed by `brake`, `hover` and, after the hover
    limit, a landing. So this is a behavior without an end, or a circle of `then`, and no `next` or
    `within` leads out of it. Failures do not count as a way out. A `then` that is never taken is
    reported as KYB206 alone.
    """
    for vehicle in case.vehicles():
        flights, endless = flights_of(case, vehicle), endless_states(vehicle) - _told(vehicle)
        if flights.broken or not _reached(vehicle) <= {*vehicle.states, *TARGETS}:
            continue
        stuck = {node.state for node in flights.nodes - comes_down(vehicle, flights, endless)}
        ahead = _ahead(flights)
        told: set[str] = set()
        for name in [*(n for n in vehicle.states if n in endless), *vehicle.states]:
            if name not in stuck or name in told:
                continue
            circle = _circle(name, ahead, endless)
            if told.isdisjoint(circle):
                yield _never_down(vehicle, name, circle)
            told.update(circle)


def _never_down(vehicle: Vehicle, name: str, circle: list[str]) -> Diagnostic:
    part = vehicle.states[name].part.name.text
    note = f"`{name}` ({part}) never ends by itself"
    if len(circle) > 1:
        note = "`" + "` → `".join(circle) + "`"
    return Diagnostic(
        "KYB205",
        f"after `{name}` the vehicle never comes down",
        vehicle.states[name].name.span,
        label="no way to the ground from here",
        notes=(note,),
        help="add a `next` or a `within` that leads to a landing, such as `auto_land`",
    )


def _told(vehicle: Vehicle) -> set[str]:
    """The states with a `then`: where it is never taken, KYB206 says so."""
    states = vehicle.states.items()
    return {name for name, s in states if any(t.cause == "then" for t in s.transitions)}


def _ahead(flights: Flights) -> dict[str, str]:
    """Where the `then` of each state leads."""
    thens = (link for link in flights.links if link.transition.cause == "then")
    return {link.source.state: link.transition.target.text for link in thens}


def _circle(name: str, ahead: dict[str, str], endless: AbstractSet[str]) -> list[str]:
    """The states from `name` on, along `then`, up to the first that comes twice or never ends."""
    path, passed = [name], {name}
    while path[-1] in ahead and path[-1] not in endless:
        path.append(ahead[path[-1]])
        if path[-1] in passed:
            break
        passed.add(path[-1])
    return path
