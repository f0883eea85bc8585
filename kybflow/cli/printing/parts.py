"""The output of `kybflow parts`: all parts, one part, or the page docs/parts.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import Enum
from typing import Annotated, Any, get_args, get_origin

from kybflow.cli.output import columns
from kybflow.core import units
from kybflow.core.events import BaseEvent, RunEvent
from kybflow.core.params import Field, fields_of, type_of
from kybflow.core.signals import MeasurementKind, kind_name
from kybflow.core.sources import help_of, hints_of
from kybflow.core.units import Dimension, Vec3
from kybflow.dsl.reading.values import bounds_of, shown_value
from kybflow.parts.catalog import Catalog, PartSpec, own_catalog
from kybflow.parts.events import ENGINE_EVENTS
from kybflow.world.vehicle_context import Airframe

_WAITED_FOR = {
    "anywhere": "yes",
    "to log it": "by a callback that logs it",
    "too late": "no: the run is over then",
    "nowhere": "no: it is recorded only",
}


def event_table(catalog: Catalog) -> Iterator[str]:
    """Yield the lines of a Markdown table: the engine's events, then those that parts declare."""
    yield "| event | of | when | it carries | can be waited for |"
    yield "|---|---|---|---|---|"
    for event in ENGINE_EVENTS.values():
        yield _row(event, _owner(event))
    owners: dict[type[BaseEvent], list[str]] = {}
    for kind in ("behaviors", "processors"):
        for name in catalog.names(kind):
            for own in catalog.get(kind, name).cls.own_events:
                owners.setdefault(own, []).append(f"`{name}`")
    for event, names in owners.items():
        yield _row(event, ", ".join(names))


def _owner(event: type[BaseEvent]) -> str:
    if issubclass(event, RunEvent):
        return "the run"
    return "a vehicle" if event.needs is None else f"a vehicle with {event.needs}"


def _row(event: type[BaseEvent], owner: str) -> str:
    hints = hints_of(event)
    fields = ", ".join(f"`{field}`{_unit(hints[field])}" for field in event.fields)
    cells = (f"`{event.name}`", owner, help_of(event), fields, _WAITED_FOR[event.awaited])
    return f"| {' | '.join(cells)} |"


def _unit(hint: object) -> str:
    """Return the SI unit of a field in brackets; empty if it has none."""
    found = (part for kind in (hint, *get_args(hint)) for part in get_args(kind))
    units = [part.si for part in found if isinstance(part, Dimension) and part.si]
    return f" [{units[0]}]" if units else ""


_NO_OPTIONS = ("drivers", "sensors", "inputs", "faults", "actions")
"""The kinds of parts whose parameters can't change during a run."""


def list_parts(catalog: Catalog) -> str:
    """Return a list of all parts by kind, with their summaries."""
    blocks = []
    for kind in catalog.kinds():
        if specs := [catalog.get(kind, name) for name in catalog.names(kind)]:
            rows = columns([(spec.name, spec.summary) for spec in specs], indent="  ")
            blocks.append("\n".join([kind, *rows]))
    return "\n\n".join(blocks)


def show_part(catalog: Catalog, name: str) -> str:
    """Return the documentation of every part called `name`; empty if there is none."""
    kinds = [kind for kind in catalog.kinds() if name in catalog.names(kind)]
    return "\n\n".join("\n".join(_part(catalog.get(kind, name))) for kind in kinds)


def _part(spec: PartSpec) -> Iterator[str]:
    yield f"{spec.name} ({spec.kind[:-1]})\n\n{spec.doc.strip()}\n"
    if legs := getattr(spec.cls, "flight", ()):
        ways = ", ".join(f"{leg.start.value} to {leg.end.value}" for leg in legs)
        yield f"flight: {ways}\n"
    if spec.fields:
        head = ("parameter", "type", "default", "bounds", "help")
        yield from columns([head, *map(_cells, spec.fields)], indent="  ")
    else:
        yield "No parameters."


def _cells(field: Field) -> tuple[str, str, str, str, str]:
    default = "needed" if field.required else shown_value(field.default, field)
    return field.name, type_of(field), default, bounds_of(field), field.help


def page() -> str:
    """Return `docs/parts.md`, made from the template `parts.md`. It contains only kybflow's own
    parts, so that it is the same on every machine."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    catalog = own_catalog()
    environment = Environment(
        loader=PackageLoader("kybflow.cli", "printing"),
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template("parts.md").render(
        catalog=catalog,
        cells=_cells,
        in_flight=_in_flight,
        facts=lambda spec: "; ".join(_facts(spec)),
        are_options=lambda kind: kind not in _NO_OPTIONS,
        airframe=fields_of(Airframe),
        types=_types(),
        events="\n".join(event_table(catalog)),
    )


def _types() -> Iterator[tuple[str, ...]]:
    """Yield the dimension, name, values, units and an example of each type that has a unit."""
    shapes = {float: "a number", Vec3: "`[x, y, z]`", tuple[Vec3, ...]: "`[[x, y, z], ...]`"}
    for name, hint in vars(units).items():
        if get_origin(hint) is Annotated:
            base, dimension = get_args(hint)
            known = ", ".join(f"`{unit}`" for unit in dimension.units) or "none"
            yield dimension.name, f"`{name}`", shapes[base], known, f"`{dimension.example}`"
    size, like = "3 rows of 3, `[[...], ...]`", "`[[1, 0, 0], [0, 1, 0], [0, 0, 1]]`"
    yield "matrix of any of these", "`Matrix[3, 3, Damping]`", size, "those of `Damping`", like


def _in_flight(field: Field) -> str:
    if field.read_only or field.type.fixed:
        return "never"
    if field.tightens is None:
        return ""
    if field.shape == "boolean":
        return f"only to {'true' if field.tightens == 'up' else 'false'}"
    return "only severer" if field.choices else f"only {field.tightens}"


def _facts(spec: PartSpec) -> Iterator[str]:
    """Yield the facts that a part's class declares in addition to its parameters."""
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
    """Return the members' values in order of declaration."""
    kept = set(members)
    found = [member for kind in {type(m): None for m in kept} for member in kind if member in kept]
    return ", ".join(str(member.value).replace("_", " and ") for member in found)
