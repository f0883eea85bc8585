"""Names of options, `a.processors.limit_speed.speed`, and of vehicles and groups before a dot, in
what a mission asks for: who is meant, and which parameter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.params import Field, names_in
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Findings
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.document import ActionEntry, Document, PartUse, VehicleEntry
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.reading.values import decode

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


class Option(NamedTuple):
    """One parameter of a vehicle's part; `declared` is its value (SI) in the mission."""

    name: str
    field: Field
    declared: Any


def members(document: Document, name: str) -> tuple[str, ...]:
    """The vehicles that a name stands for: itself, or those of a group; none for an unknown one."""
    if name in document.vehicles:
        return (name,)
    group = document.groups.get(name, ())
    return tuple(member.text for member in group if member.text in document.vehicles)


def unknown_vehicle(
    code: str, name: Text, document: Document, start: int = 0, end: int | None = None
) -> Diagnostic:
    """The finding for the part of `name` that is no vehicle or group."""
    stop = len(name.text) if end is None else end
    word = name.text[start:stop]
    return Diagnostic(
        code,
        f"there is no vehicle `{word}`",
        name.part(start, stop),
        label="unknown",
        help=did_you_mean(word, (*document.vehicles, *document.groups)),
    )


def no_vehicle(code: str, name: str, span: Span, document: Document) -> Diagnostic:
    """The finding for the name of a vehicle that isn't there, where no group may stand."""
    hint = did_you_mean(name, document.vehicles)
    if any(obstacle.name.text == name for obstacle in document.obstacles):
        hint = "it stands in the world, and what stands there counts as an obstacle anyway"
    return Diagnostic(code, f"there is no vehicle `{name}`", span, label="unknown", help=hint)


def no_vehicles(code: str, use: PartUse, document: Document) -> Iterator[Diagnostic]:
    """The finding for each vehicle that a part names and that isn't there."""
    for parameter, name in names_in(use.params, "vehicle"):
        if name not in document.vehicles:
            span = use.spans.get(parameter, use.name.span)
            yield no_vehicle(code, name, span, document)


def option_values(
    action: ActionEntry, document: Document, catalog: Catalog, found: Findings
) -> tuple[tuple[Option, Any], ...]:
    """The options that `{OPTION: VALUE}` sets, each with its value (SI); empty, with findings,
    where it has errors."""
    assert action.target is not None
    own, values = Findings(), []
    for option in options_named(action.target, document, catalog, found):
        value = own.take(decode(action.value, option.field))
        values.append((option, value))
        for name in option.field.named(value, "vehicle"):
            if name not in document.vehicles:
                own.add(no_vehicle("KYB510", name, action.value.span, document))
    found.add(dict.fromkeys(own.all))
    return () if own.all else tuple(values)


def options_named(
    name: Text, document: Document, catalog: Catalog, found: Findings
) -> tuple[Option, ...]:
    """The options that `name` means, of a vehicle or of each of a group; empty where it has
    errors."""
    first, _, rest = name.text.partition(".")
    vehicles = members(document, first)
    if not vehicles:
        found.add(unknown_vehicle("KYB233", name, document, end=len(first)))
    options: list[Option] = []
    for vehicle in vehicles:
        option = _option(name, rest, document.vehicles[vehicle], catalog, found)
        if option is None:
            return ()
        options.append(option)
    return tuple(options)


def _option(
    name: Text, rest: str, vehicle: VehicleEntry, catalog: Catalog, found: Findings
) -> Option | None:
    parts, owner, end = _parts(vehicle, catalog), vehicle.name.text, len(name.text)
    label, _, word = rest.rpartition(".")
    start = end - len(rest)
    field = next((f for f in parts[label][0] if f.name == word), None) if label in parts else None
    if rest in parts:
        message = f"`{name.text}` is a part, and not one of its parameters"
        hint = did_you_mean("", [f"{rest}.{field.name}" for field in parts[rest][0]])
        found.report("KYB233", message, name.part(start, end), help=hint)
    elif not rest:
        hint = "an option is `VEHICLE.PART.PARAMETER`, like `a.processors.limit_speed.speed`"
        found.report("KYB233", f"`{name.text}` is no option", name.span, help=hint)
    elif label not in parts:
        part = label or rest
        message, hint = f"`{owner}` has no part `{part}`", did_you_mean(part, parts)
        span = name.part(start, start + len(part))
        found.report("KYB233", message, span, "unknown", help=hint)
    elif field is None:
        message = f"`{label}` of `{owner}` has no parameter `{word}`"
        hint = did_you_mean(word, [field.name for field in parts[label][0]])
        found.report("KYB233", message, name.part(end - len(word), end), "unknown", help=hint)
    else:
        return Option(f"{owner}.{rest}", field, getattr(parts[label][1], word))
    return None


def _parts(vehicle: VehicleEntry, catalog: Catalog) -> dict[str, tuple[tuple[Field, ...], Any]]:
    """Every part of a vehicle by its label among the options, with its parameters."""
    uses = {
        **{f"estimators.{use.part.label}": use.part for use in vehicle.estimators},
        **{f"processors.{use.label}": use for use in vehicle.processors},
        "tracker": vehicle.tracker,
        **{f"supervisors.{use.label}": use for use in vehicle.supervisors},
        **{f"behaviors.{name}": state.part for name, state in vehicle.states.items()},
    }
    built_in = {
        f"behaviors.{name}": (spec.fields, spec.params())
        for name, part in BUILT_IN.items()
        for spec in (catalog.get("behaviors", part),)
    }
    return {**built_in, **{label: (use.spec.fields, use.params) for label, use in uses.items()}}
