"""The mission as every check receives it, and lookups shared by several checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple, TypeVar, cast

from kybflow.core.errors import PartError
from kybflow.core.params import Field, fields_with
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Text, goals_like
from kybflow.dsl.expressions import Condition, Expression, Scope, parse
from kybflow.dsl.expressions.tokens import KEYWORDS
from kybflow.dsl.language.records import Record
from kybflow.dsl.names import BUILT_IN, Scopes
from kybflow.dsl.plan import PartPlan, Plan, StatePlan, TransitionPlan, VehiclePlan
from kybflow.flight.loops.position_loop import delay_margin
from kybflow.parts import Behavior, Flight, Leg, Objection
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from typing import Any

    from kybflow.parts.catalog import Catalog, PartSpec

T = TypeVar("T")
NO_TARGET = frozenset({"fault"})
"""Built-in states that only the failsafe enters."""

TARGETS = tuple(name for name in BUILT_IN if name not in NO_TARGET)
"""The built-in states that a mission's transitions may lead to."""


WORDS = KEYWORDS | {"all", "any", "start", "operator", "world"}
"""Words that can't be the name of a vehicle, behavior, group, flow, input or obstacle."""


class Case:
    """A mission to check. plan: the mission. catalog: the available parts. scopes: the names that
    its expressions may use."""

    def __init__(self, plan: Plan, catalog: Catalog) -> None:
        self.plan = plan
        self.catalog = catalog
        self.scopes = Scopes(plan)
        self._found: dict[Callable[[Case], Iterable[Any]], list[Any]] = {}

    def cached(self, find: Callable[[Case], Iterable[T]]) -> list[T]:
        """Return the list of the values that `find` yields for this case. It is computed once and
        shared by all checks."""
        if find not in self._found:
            self._found[find] = list(find(self))
        return self._found[find]

    def expected(self) -> Iterator[tuple[Text, Expression]]:
        """Yield every expectation that can be parsed."""
        for text, expression, _ in self.cached(parsed_expectations):
            if expression is not None:
                yield text, expression

    def states(self) -> Iterator[tuple[VehiclePlan, StatePlan]]:
        """Yield every vehicle's states, each with its vehicle."""
        for vehicle in self.plan.vehicles:
            for state in vehicle.states.values():
                yield vehicle, state

    def parts(self, kind: str) -> Iterator[PartSpec]:
        """Yield every available part of a kind. A part that can't be loaded is skipped; it is
        reported where the mission uses it."""
        for name in self.catalog.names(kind):
            with suppress(PartError):
                yield self.catalog.get(kind, name)

    def condition(self, owner: Record, key: str, scope: Scope) -> Condition | None:
        """Return the parsed condition under a key of a record; None if there is none or it has
        errors."""
        text = owner.text_of(key)
        return cast("Condition | None", None if text is None else parse(text, scope)[0])

    def behavior(self, vehicle: VehiclePlan, state: str) -> type[Behavior[Any]] | None:
        """Return the behavior class of a vehicle's state or of a built-in state; None for an
        unknown name."""
        if state in vehicle.states:
            own: type[Behavior[Any]] = vehicle.states[state].behavior.cls
            return own
        if state in BUILT_IN:
            built_in: type[Behavior[Any]] = self.catalog.get("behaviors", BUILT_IN[state]).cls
            return built_in
        return None

    def legs(self, vehicle: VehiclePlan, state: str) -> tuple[Leg, ...]:
        """Return the flight types of a state; empty for an unknown name."""
        cls = self.behavior(vehicle, state)
        return cls.flight if cls is not None else ()

    def accepts(self, vehicle: VehiclePlan, state: str, flight: Flight) -> bool:
        return any(leg.start is flight for leg in self.legs(vehicle, state))


def parsed_expectations(
    case: Case,
) -> Iterator[tuple[Text, Expression | None, list[Diagnostic]]]:
    """Yield every expectation as written and as parsed, and its errors."""
    scope = case.scopes.expectation()
    for text in case.plan.texts_of("expect"):
        yield text, *parse(text, scope)


def taken_names(plan: Plan, *more: tuple[Iterable[str], str]) -> dict[str, str]:
    """Return the names of vehicles and groups, and those of `more`, each with what already has
    it."""
    kinds: tuple[tuple[Iterable[str], str], ...] = (
        (plan.fleet, "a vehicle"), (plan.groups, "a group"), *more,
    )  # fmt: skip
    return {name: f"already the name of {kind}" for names, kind in kinds for name in names}


def transitions_of(plan: Plan) -> Iterator[TransitionPlan]:
    """Yield every transition of every behavior and phase."""
    states = (state for vehicle in plan.vehicles for state in vehicle.states.values())
    phases = (phase for flow in plan.flows for phase in flow.phases.values())
    for state in states:
        yield from state.transitions
    for phase in phases:
        yield from phase.transitions


def part_of(vehicle: VehiclePlan, state: str) -> str:
    """Return the name of the behavior part that a state runs."""
    return vehicle.states[state].behavior.name if state in vehicle.states else BUILT_IN[state]


def wrong_goal(code: str, name: Text, vehicle: VehiclePlan) -> Diagnostic | None:
    """Return the finding for a target state that the vehicle doesn't have or that only the failsafe
    enters; None for a valid target."""
    if vehicle.goal(name.text) in vehicle.states or name.text in TARGETS:
        return None
    if name.text not in NO_TARGET:
        return no_state(code, name, vehicle, TARGETS)
    return Diagnostic(
        code,
        f"`{name.text}` can't be chosen",
        name.span,
        label="only the failsafe enters it",
        help="use `auto_land` or `land_blind` to land",
    )


def no_state(code: str, name: Text, vehicle: VehiclePlan, more: tuple[str, ...] = ()) -> Diagnostic:
    """Return the finding for a name that is neither a state or chain of the vehicle nor one of
    `more`."""
    key = "inner goals" if "." in name.text else "goals"
    if key not in vehicle.known:
        vehicle.known[key] = sorted(goals_like(name.text, vehicle.states))
    return Diagnostic(
        code,
        f"`{vehicle.name}` has no behavior `{name.text}`",
        name.span,
        label="unknown",
        help=did_you_mean(name.text, (*vehicle.known[key], *more)),
    )


def objected(
    code: str, name: str, part: PartPlan, objection: Objection, related: tuple[Related, ...] = ()
) -> Diagnostic:
    """Return the finding for what a part, called `name`, objects to; a warning for a doubt."""
    return Diagnostic(
        code,
        f"`{objection.parameter}` of `{name}` {objection.reason}",
        part.span_of(objection.parameter),
        help=objection.hint,
        severity=Severity.WARNING if objection.is_doubt else Severity.ERROR,
        related=related,
    )


class Bounded(NamedTuple):
    """A parameter whose declaration says more than bounds (`limited_by`, `only_with`, `room`), of a
    behavior or a processor. state: None for a processor."""

    vehicle: VehiclePlan
    state: StatePlan | None
    part: PartPlan
    field: Field


def bounded_parameters(case: Case) -> Iterator[Bounded]:
    """Yield every parameter of the behaviors and processors that other values bound."""
    for vehicle in case.plan.vehicles:
        for state in vehicle.states.values():
            for field in fields_with(
                state.behavior.params.__class__, "limited_by", "only_with", "room"
            ):
                yield Bounded(vehicle, state, state.behavior, field)
        for part in vehicle.processors:
            for field in fields_with(part.params.__class__, "limited_by", "only_with", "room"):
                yield Bounded(vehicle, None, part, field)


def contexts(case: Case) -> Iterator[tuple[VehiclePlan, VehicleContext]]:
    """Yield every vehicle with its context. The contexts have no tags, because there may be
    thousands."""
    plan = case.plan
    diameters = {vehicle.name: vehicle.airframe.diameter for vehicle in plan.vehicles}
    starts = {vehicle.name: vehicle.start for vehicle in plan.vehicles}
    for vehicle in plan.vehicles:
        driver, airframe, tracker = vehicle.driver, vehicle.airframe, vehicle.tracker
        period = 1.0 / plan.control_rate
        inner = driver.cls.inner_loop(driver.params, airframe)
        outer = tracker.cls.outer_loop(tracker.params, airframe, inner, period)
        context = VehicleContext(
            vehicle.name, airframe, vehicle.start, vehicle.heading, plan.fence,
            period, vehicle.home, plan.obstacles, diameters,
            cameras=vehicle.own_cameras,
            payload=vehicle.payload,
            loop=inner,
            starts=starts,
            groups=plan.groups,
            delay_margin=delay_margin(outer, inner),
            objects=plan.objects,
        )  # fmt: skip
        yield vehicle, context
