"""What `kybflow parts` prints: all parts, one of them, or the page docs/parts.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import Enum
from typing import Annotated, Any, get_args, get_origin

from kybflow.core import units
from kybflow.core.params import Field, fields_of, type_of
from kybflow.core.signals import MeasurementKind, kind_name
from kybflow.core.text import did_you_mean
from kybflow.core.units import Vec3
from kybflow.dsl.reading.values import bounds_of, shown_value
from kybflow.parts.catalog import Catalog, PartSpec, own_catalog
from kybflow.parts.event_table import event_table
from kybflow.world.vehicle_context import Airframe

_INTRODUCTION = """\
# Parts

What a mission can name. `kybflow parts` lists the same, with the parts of packages that are
installed beside kybflow; `kybflow parts NAME` says more of one: its equations, what it refuses.

A number without a unit is SI; an angle always has one. `in flight` says how a parameter may change
as an option while its vehicle flies: freely where nothing stands, in one direction where it keeps
the vehicle safe, or never. What `ground → air` means: [the mission
language](mission-language.md#behaviors-and-transitions).

This page is made from the parts: `kybflow parts --write docs/parts.md`.
"""
_KINDS = {
    "behaviors": "`do: NAME`: where the vehicle should be now.",
    "estimators": "`estimators: [{use: NAME}]`: where the vehicle is ([Choose estimators]"
    "(estimators.md)).",
    "processors": "`processors: [{use: NAME}]`: what may bend the setpoint. A safety part can't be "
    "switched off.",
    "trackers": "`tracker: {use: NAME}`: the setpoint becomes a command.",
    "supervisors": "`supervisors: [{use: NAME}]`: what watches a bound ([What happens when "
    "something breaks](failsafe.md)).",
    "drivers": "`targets: {lab: {all: {driver: {use: NAME}}}}`: how a vehicle is reached.",
    "sensors": "`targets: {lab: {VEHICLE: {sensors: {ESTIMATOR: {use: NAME}}}}}`: where an "
    "estimator's measurements come from, when the driver has none.",
    "inputs": "`inputs: {NAME: {use: NAME}}`, or in a target: what a person steers with ([Fly with "
    "your hands](steering.md)).",
    "faults": "`faults: [{at: 5 s, on: VEHICLE, inject: NAME}]`: what breaks: in "
    "simulation, and our side of it on a firmware's own simulator.",
    "actions": "`on: [{event: ..., do: [{NAME: {...}}]}]`: what a callback does. The language's "
    "own stand in [Callbacks](mission-language.md#callbacks); kybflow has no others, "
    "[a package](your-own-parts.md#an-action) may.",
}
_AIRFRAMES = (
    "`airframes: {NAME: {...}}`, in a mission or a library: what flies, as the controller believes "
    "it. It is no part, and its keys are these, beside `like`."
)
_TYPES = (
    "What a parameter can be that is a quantity, and the type in `kybflow.core.units` with which a "
    "part declares it. In a mission it has one of the units, in Python it is SI: an angle in "
    "radians, a ratio of 20 % as 0.2. Besides, a parameter can be an `int`, a `bool`,"
    " a `str`, a choice (`Literal['near', 'far']`), a list of whole numbers (`tuple[int, ...]`), or"
    " a file (`kybflow.core.files.File`, which is read, and `FilePath`, which is not)."
)
_EVENTS = (
    "What happens, for `next` and `on` to answer ([Events](mission-language.md#events)), and what"
    " it carries. An alarm carries `reaction`, `reason`, `value` and `bound`; its supervisor or"
    " processor, above, names it."
)
_COLUMNS = ("parameter", "type", "default", "bounds", "in flight", "what it is")
_NO_OPTIONS = ("drivers", "sensors", "inputs", "faults", "actions")
"""The kinds whose parameters stay what they are when a run begins."""


def list_parts(catalog: Catalog) -> str:
    """Every part by kind, each with its summary."""
    return "\n\n".join(_kind(catalog, kind) for kind in catalog.kinds() if catalog.names(kind))


def _kind(catalog: Catalog, kind: str) -> str:
    specs = [catalog.get(kind, name) for name in catalog.names(kind)]
    width = max(len(spec.name) for spec in specs)
    return "\n".join([kind, *(f"  {s.name:<{width}}  {s.summary}" for s in specs)])


def show_part(catalog: Catalog, name: str) -> str | None:
    """The documentation of every part called `name`; None when there is none."""
    kinds = [kind for kind in catalog.kinds() if name in catalog.names(kind)]
    return "\n\n".join("\n".join(_part(catalog.get(k, name))) for k in kinds) or None


def unknown_part(catalog: Catalog, name: str) -> str:
    """The message for a name that no part has."""
    known = {known for kind in catalog.kinds() for known in catalog.names(kind)}
    return f"no part is called `{name}`; {did_you_mean(name, known)}"


def _part(spec: PartSpec) -> Iterator[str]:
    yield f"{spec.name} ({spec.kind[:-1]})"
    yield ""
    yield spec.doc.strip()
    legs = getattr(spec.cls, "flight", ())
    if legs:
        yield ""
        yield "flight: " + ", ".join(f"{leg.start.value} to {leg.end.value}" for leg in legs)
    yield ""
    if not spec.fields:
        yield "No parameters."
        return
    rows = [("parameter", "type", "default", "bounds", "help"), *map(_row, spec.fields)]
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    for row in rows:
        cells = (f"{cell:<{width}}" for cell, width in zip(row, widths, strict=False))
        yield f"  {'  '.join(cells)}  {row[4]}"


def _row(field: Field) -> tuple[str, str, str, str, str]:
    default = "needed" if field.required else shown_value(field.default, field)
    return field.name, type_of(field), default, bounds_of(field), field.help


def page() -> str:
    """`docs/parts.md`: kybflow's own parts. Those of installed packages are left out, so that the
    page is the same on every machine."""
    return "\n".join(_page()) + "\n"


def _page() -> Iterator[str]:
    catalog = own_catalog()
    yield _INTRODUCTION
    for kind in catalog.kinds():
        names = ", ".join(f"`{name}`" for name in catalog.names(kind))
        yield f"- [{kind.capitalize()}](#{kind}): {names or 'none'}"
    yield "- [Airframes](#airframes)"
    yield "- [Types](#types)"
    yield "- [Events](#events)"
    for kind in catalog.kinds():
        yield f"\n## {kind.capitalize()}\n\n{_KINDS[kind]}"
        for name in catalog.names(kind):
            yield from _section(catalog.get(kind, name))
    yield f"\n## Airframes\n\n{_AIRFRAMES}"
    yield from _table(fields_of(Airframe), are_options=False)
    yield from _types()
    yield f"\n## Events\n\n{_EVENTS}\n"
    yield from event_table(catalog)


def _types() -> Iterator[str]:
    """The table of the types that carry a unit."""
    yield "\n## Types\n\n" + _TYPES
    yield "\n| type | in Python | a value is | units | like |\n|---|---|---|---|---|"
    shapes = {float: "a number", Vec3: "`[x, y, z]`", tuple[Vec3, ...]: "`[[x, y, z], ...]`"}
    for name, hint in vars(units).items():
        if get_origin(hint) is Annotated:
            base, dimension = get_args(hint)
            known = ", ".join(f"`{unit}`" for unit in dimension.units) or "none"
            cells = (dimension.name, f"`{name}`", shapes[base], known, f"`{dimension.example}`")
            yield f"| {' | '.join(cells)} |"


def _section(spec: PartSpec) -> Iterator[str]:
    yield f"\n### {spec.name}\n\n{spec.summary}"
    facts = "; ".join(_facts(spec))
    if facts:
        yield f"\n{facts[0].upper()}{facts[1:]}."
    if not spec.fields:
        yield "\nNo parameters."
        return
    yield from _table(spec.fields, spec.kind not in _NO_OPTIONS)


def _table(fields: Iterable[Field], are_options: bool) -> Iterator[str]:
    rows = [_COLUMNS, *map(_cells, fields)]
    if not are_options:
        rows = [row[:4] + row[5:] for row in rows]
    head, *body = (f"| {' | '.join(row)} |" for row in rows)
    yield f"\n{head}\n|{'---|' * len(rows[0])}"
    yield from body


def _cells(field: Field) -> tuple[str, ...]:
    kind = type_of(field).replace("|", r"\|")
    default = "needed" if field.required else shown_value(field.default, field)
    return (f"`{field.name}`", kind, default, bounds_of(field), _in_flight(field), field.help)


def _in_flight(field: Field) -> str:
    if field.read_only or field.type.fixed:
        return "never"
    if field.tightens is None:
        return ""
    if field.shape == "boolean":
        return f"only to {'true' if field.tightens == 'up' else 'false'}"
    return "only severer" if field.choices else f"only {field.tightens}"


def _facts(spec: PartSpec) -> Iterator[str]:
    """The facts that the class declares beside its parameters."""
    cls: Any = spec.cls
    if spec.kind == "behaviors":
        yield ", ".join(f"{leg.start.value} → {leg.end.value}" for leg in cls.flight)
        yield f"gives {_values([cls.emits])}"
        yield from ([] if cls.needs_estimate else ["needs no estimate"])
        yield from (["keeps a common pace"] if cls.keeps_pace else [])
    elif spec.kind == "processors":
        yield from (["a safety part"] if cls.safety else [])
        yield f"takes {_values(cls.accepts)}"
        yield from (f"retunes `{option}` of the tracker" for option in sorted(cls.retunes))
    elif spec.kind == "trackers":
        yield f"takes {_values(cls.accepts)}"
        yield f"gives {_values(cls.kinds(spec.params()))}"
    elif spec.kind == "supervisors":
        yield "in every vehicle" if cls.always else "in the vehicles that name it"
        yield from (f"default reaction `{f.default}`" for f in spec.fields if f.name == "reaction")
    elif spec.kind == "drivers":
        yield "simulated" if cls.simulated else "hardware"
        yield f"takes {_values(cls.accepts)}"
        yield f"provides {_kinds(cls.provides)}"
        yield from ([f"performs {', '.join(f'`{act}`' for act in cls.acts)}"] if cls.acts else [])
    elif spec.kind == "faults":
        yield from (["on a firmware's own simulator too"] if cls.ours else [])
    elif spec.kind == "sensors":
        yield from (["in a simulation only"] if cls.simulated else [])
        yield f"provides {_kinds(cls.provides)}"
    if getattr(cls, "needs", ()):
        yield f"uses {_kinds(cls.needs)}"
    if cls.events:
        word = "alarms" if spec.kind == "supervisors" else "emits"
        yield f"{word} {', '.join(f'`{name}`' for name in cls.events)}"


def _kinds(kinds: Iterable[MeasurementKind]) -> str:
    return ", ".join(sorted(map(kind_name, kinds)))


def _values(members: Iterable[Enum]) -> str:
    """The members' values, in the order of their declaration."""
    kept = set(members)
    found = [member for kind in {type(m): None for m in kept} for member in kind if member in kept]
    return ", ".join(str(member.value).replace("_", " and ") for member in found)
