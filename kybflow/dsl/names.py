"""The names that a mission may use: the states that every vehicle has, options such as
`a.processors.limit_speed.speed`, and the scopes of expressions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.params import Field, names_in
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Collector, Diagnostic, Span, Text
from kybflow.dsl.expressions import Scope
from kybflow.dsl.expressions.semantics import ObjectNames
from kybflow.dsl.plan import PartPlan, Plan, VehiclePlan
from kybflow.dsl.reading.nodes import Node
from kybflow.dsl.reading.values import decode_value
from kybflow.parts import AIR, GROUND, Leg
from kybflow.parts.observables import OBJECT_OBSERVABLES, chains_of

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

LANDED, FAULT = "landed", "fault"
BRAKE, HOVER = "brake", "hover"
AUTO_HOME, AUTO_LAND, LAND_BLIND = "auto_home", "auto_land", "land_blind"

BUILT_IN = {
    LANDED: "wait_on_ground",
    BRAKE: "brake",
    HOVER: "hover",
    AUTO_HOME: "go_home",
    AUTO_LAND: "land",
    LAND_BLIND: "land_blind",
    FAULT: "wait_on_ground",
}
"""The behavior of each built-in state. `brake` is followed by `hover`, `hover` after `hover_limit`
by `auto_land`, `auto_home` by `auto_land`, `auto_land` by `landed`, and `land_blind` by `fault`,
which only a reset leaves."""


def end_of(legs: Iterable[Leg]) -> str:
    """Return the state that follows a behavior without `then` when it is done."""
    return BRAKE if any(leg.end is AIR for leg in legs) else LANDED


def failure_of(legs: Iterable[Leg]) -> str:
    """Return the state that follows a behavior without `failed` when it fails: `landed` if it stays
    on the ground, `brake` if it can begin and end in the air, `auto_land` for a take-off or a
    landing, during which the vehicle may be on the ground."""
    every = tuple(legs)
    if all(leg == (GROUND, GROUND) for leg in every):
        return LANDED
    return BRAKE if (AIR, AIR) in every else AUTO_LAND


class Option(NamedTuple):
    """One parameter of a part of a vehicle. name: the option's name. declared: its value (SI) in
    the mission."""

    name: str
    field: Field
    declared: Any

    @property
    def place(self) -> tuple[str, str]:
        """The vehicle's name and the part's label."""
        vehicle, _, rest = self.name.partition(".")
        return vehicle, rest.rpartition(".")[0]


def unknown_vehicle(
    code: str, name: Text, plan: Plan, start: int = 0, end: int | None = None
) -> Diagnostic:
    """Return the finding about the characters `start` to `end` of `name`, which are not a vehicle
    or group."""
    stop = len(name.text) if end is None else end
    word, place = name.text[start:stop], name.part(start, stop)
    hint = did_you_mean(word, (*plan.fleet, *plan.groups))
    return Diagnostic(code, f"there is no vehicle `{word}`", place, label="unknown", help=hint)


def no_vehicle(code: str, name: str, span: Span, plan: Plan) -> Diagnostic:
    """Return the finding about the name of a missing vehicle where a group is not allowed."""
    hint = did_you_mean(name, plan.fleet)
    if name in plan.obstacles:
        hint = "obstacles of the world are always avoided"
    return Diagnostic(code, f"there is no vehicle `{name}`", span, label="unknown", help=hint)


def no_vehicles(code: str, use: PartPlan, plan: Plan) -> Iterator[Diagnostic]:
    """Yield the finding for each missing vehicle that a part names."""
    for parameter, name in names_in(use.params, "vehicle"):
        if name not in plan.fleet:
            yield no_vehicle(code, name, use.span_of(parameter), plan)


def option_values(
    name: Text, value: Node, plan: Plan, catalog: Catalog, found: Collector
) -> tuple[tuple[Option, Any], ...]:
    """Return the options that `{OPTION: VALUE}` sets, each with its value (SI); empty if there are
    errors, which are reported."""
    own = Collector()
    options = options_named(name, plan, catalog, own)
    values = [decode_value(value, option.field, own) for option in options]
    for option, decoded in zip(options, values, strict=True):
        for vehicle in option.field.named(decoded, "vehicle"):
            if vehicle not in plan.fleet:
                own.add(no_vehicle("KYB510", vehicle, value.span, plan))
    found.add(dict.fromkeys(own.all))
    return () if own.all else tuple(zip(options, values, strict=True))


def options_named(name: Text, plan: Plan, catalog: Catalog, found: Collector) -> tuple[Option, ...]:
    """Return the options that `name` stands for, of one vehicle or of each in a group; empty if
    there are errors, which are reported."""
    first, _, rest = name.text.partition(".")
    vehicles = plan.members(first)
    if not vehicles:
        found.add(unknown_vehicle("KYB233", name, plan, end=len(first)))
    options = [_option(name, rest, plan.fleet[vehicle], catalog, found) for vehicle in vehicles]
    return tuple(option for option in options if option is not None) if None not in options else ()


def _option(
    name: Text, rest: str, vehicle: VehiclePlan, catalog: Catalog, found: Collector
) -> Option | None:
    parts = _parts(vehicle, catalog)
    label, _, word = rest.rpartition(".")
    start, end = len(name.text) - len(rest), len(name.text)
    field = next((f for f in parts[label][0] if f.name == word), None) if label in parts else None
    if field is not None:
        return Option(f"{vehicle.name}.{rest}", field, getattr(parts[label][1], word))
    if rest in parts:
        known = [f"{rest}.{field.name}" for field in parts[rest][0]]
        message = f"`{name.text}` is a part, and not one of its parameters"
        found.report("KYB233", message, name.part(start, end), help=did_you_mean("", known))
    elif not rest:
        hint = "an option is `VEHICLE.PART.PARAMETER`, like `a.processors.limit_speed.speed`"
        found.report("KYB233", f"`{name.text}` is not an option", name.span, help=hint)
    elif label not in parts:
        part = label or rest
        message, hint = f"`{vehicle.name}` has no part `{part}`", did_you_mean(part, parts)
        found.report("KYB233", message, name.part(start, start + len(part)), "unknown", help=hint)
    else:
        message = f"`{label}` of `{vehicle.name}` has no parameter `{word}`"
        hint = did_you_mean(word, [field.name for field in parts[label][0]])
        found.report("KYB233", message, name.part(end - len(word), end), "unknown", help=hint)
    return None


def _parts(vehicle: VehiclePlan, catalog: Catalog) -> dict[str, tuple[tuple[Field, ...], Any]]:
    """Return the fields and parameters of each part of a vehicle, by the part's label among the
    options."""
    parts = {
        f"behaviors.{name}": (spec.fields, spec.params())
        for name, part in BUILT_IN.items()
        for spec in (catalog.get("behaviors", part),)
    }
    uses = (
        *(use.part for use in vehicle.estimators), *vehicle.processors, vehicle.tracker,
        *vehicle.supervisors, *(state.behavior for state in vehicle.states.values()),
    )  # fmt: skip
    return parts | {use.label: (use.fields, use.params) for use in uses}


class Scopes:
    """The scope of every expression of a plan. Each scope is created once, because it caches the
    parsed texts."""

    def __init__(self, plan: Plan) -> None:
        vehicles, fleet = plan.vehicles, plan.fleet
        self._states = {
            v.name: (
                *v.states,
                *dict.fromkeys(c for s in v.states for c in chains_of(s)),
                *BUILT_IN,
            )
            for v in vehicles
        }
        estimators = {v.name: tuple(use.part.alias for use in v.estimators) for v in vehicles}
        groups = {
            name: tuple(member for member in members if member in fleet)
            for name, members in plan.groups.items()
        }
        carriers = frozenset(v.name for v in vehicles if v.payload is not None)
        obstacles = dict.fromkeys(plan.touchable, False) | dict.fromkeys(plan.kept_clear, True)
        objects = {
            name: ObjectNames(
                [value for value, read in OBJECT_OBSERVABLES.items() if read.has(one)],
                [surface.name for surface in one.surfaces],
            )
            for name, one in plan.objects.items()
        }
        self._known = (estimators, plan.points, groups, carriers, obstacles, objects)
        self._inputs = {use.name: use.axes for use in plan.inputs}
        self._conditions: dict[str | None, Scope] = {}
        self._health = {own: Scope("health", {}, own) for own in fleet}
        self._expectation = Scope("expectation", self._states, None, *self._known)

    def condition(self, vehicle: str | None) -> Scope:
        """Return the scope of a `when` of `vehicle`; None for a flow or callback. The name of a
        chain counts as a state, which is active in all states of the chain."""
        if vehicle not in self._conditions:
            scope = Scope("condition", self._states, vehicle, *self._known, self._inputs)
            self._conditions[vehicle] = scope
        return self._conditions[vehicle]

    def flow(self) -> Scope:
        """Return the scope of a `when` in a phase or callback, in which every vehicle is named."""
        return self.condition(None)

    def health(self, vehicle: str) -> Scope:
        """Return the scope of `healthy` of an estimator: its own age and spread."""
        return self._health[vehicle]

    def expectation(self) -> Scope:
        return self._expectation
