"""Resolve the names of options, `a.processors.limit_speed.speed`, and of the vehicles and groups
before the first dot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.params import Field, names_in
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Diagnostic, Findings, Span, Text
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import PartPlan, Plan, VehiclePlan
from kybflow.dsl.reading.nodes import Node
from kybflow.dsl.reading.values import decode_value

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


class Option(NamedTuple):
    """One parameter of a part of a vehicle. name: the option's name. declared: its value (SI) in
    the mission."""

    name: str
    field: Field
    declared: Any


def unknown_vehicle(
    code: str, name: Text, plan: Plan, start: int = 0, end: int | None = None
) -> Diagnostic:
    """Return the finding about the characters `start` to `end` of `name`, which are not a vehicle
    or group."""
    stop = len(name.text) if end is None else end
    word = name.text[start:stop]
    return Diagnostic(
        code,
        f"there is no vehicle `{word}`",
        name.part(start, stop),
        label="unknown",
        help=did_you_mean(word, (*plan.fleet, *plan.groups)),
    )


def no_vehicle(code: str, name: str, span: Span, plan: Plan) -> Diagnostic:
    """Return the finding about the name of a missing vehicle where a group is not allowed."""
    hint = did_you_mean(name, plan.fleet)
    if name in plan.obstacles:
        hint = "it stands in the world, and what stands there counts as an obstacle anyway"
    return Diagnostic(code, f"there is no vehicle `{name}`", span, label="unknown", help=hint)


def no_vehicles(code: str, use: PartPlan, plan: Plan) -> Iterator[Diagnostic]:
    """Yield the finding for each missing vehicle that a part names."""
    for parameter, name in names_in(use.params, "vehicle"):
        if name not in plan.fleet:
            yield no_vehicle(code, name, use.span_of(parameter), plan)


def option_values(
    name: Text, value: Node, plan: Plan, catalog: Catalog, found: Findings
) -> tuple[tuple[Option, Any], ...]:
    """Return the options that `{OPTION: VALUE}` sets, each with its value (SI); empty if there are
    errors, which are reported."""
    own = Findings()
    options = options_named(name, plan, catalog, own)
    values = [decode_value(value, option.field, own) for option in options]
    for option, decoded in zip(options, values, strict=True):
        for vehicle in option.field.named(decoded, "vehicle"):
            if vehicle not in plan.fleet:
                own.add(no_vehicle("KYB510", vehicle, value.span, plan))
    found.add(dict.fromkeys(own.all))
    return () if own.all else tuple(zip(options, values, strict=True))


def options_named(name: Text, plan: Plan, catalog: Catalog, found: Findings) -> tuple[Option, ...]:
    """Return the options that `name` stands for, of one vehicle or of each in a group; empty if
    there are errors, which are reported."""
    first, _, rest = name.text.partition(".")
    vehicles = plan.members(first)
    if not vehicles:
        found.add(unknown_vehicle("KYB233", name, plan, end=len(first)))
    options = [_option(name, rest, plan.fleet[vehicle], catalog, found) for vehicle in vehicles]
    return tuple(option for option in options if option is not None) if None not in options else ()


def _option(
    name: Text, rest: str, vehicle: VehiclePlan, catalog: Catalog, found: Findings
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
