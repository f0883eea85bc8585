"""What missions can use: the output of `kybflow parts` (all parts, one part, or the page
docs/parts.md) and of `kybflow library` (everything that packages ship, one file, or one name)."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable, Iterator
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from kybflow.api import library
from kybflow.cli.output import columns, grouped
from kybflow.core import units
from kybflow.core.errors import KybflowError
from kybflow.core.events import BaseEvent, RunEvent
from kybflow.core.params import Field, fields_of, type_of
from kybflow.core.signals import MeasurementKind, kind_name
from kybflow.core.sources import help_of, hints_of
from kybflow.core.units import Dimension, Vec3
from kybflow.dsl.diagnostics import render
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, entries_of
from kybflow.dsl.reading.values import bounds_of, shown_value
from kybflow.parts.catalog import Catalog, PartSpec, own_catalog
from kybflow.parts.events import ENGINE_EVENTS
from kybflow.world.vehicle_context import Airframe

_NO_OPTIONS = ("drivers", "sensors", "inputs", "faults", "actions", "coordinators")
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
    blocks = []
    for spec in (
        catalog.get(kind, name) for kind in catalog.kinds() if name in catalog.names(kind)
    ):
        lines = [f"{spec.name} ({spec.kind[:-1]})\n\n{spec.doc.strip()}\n"]
        if legs := getattr(spec.cls, "flight", ()):
            ways = ", ".join(f"{leg.start.value} to {leg.end.value}" for leg in legs)
            lines.append(f"flight: {ways}\n")
        if spec.fields:
            head = ("parameter", "type", "default", "bounds", "help")
            lines += columns([head, *map(_cells, spec.fields)], indent="  ")
        else:
            lines.append("No parameters.")
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


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
        in_flight=in_flight,
        facts=lambda spec: "; ".join(facts(spec)),
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
    yield "matrix of these units", "`Matrix[3, 3, Damping]`", size, "those of `Damping`", like


_WAITED_FOR = {
    "anywhere": "yes",
    "to log it": "by a callback that logs it",
    "too late": "no: the run has ended",
    "nowhere": "no: it is only recorded",
}


def event_table(catalog: Catalog) -> Iterator[str]:
    """Yield the lines of a Markdown table: the engine's events, then those that parts declare."""
    yield "| event | of | when | fields | can be waited for |"
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


def in_flight(field: Field) -> str:
    if field.read_only or field.type.fixed:
        return "never"
    if field.tightens is None:
        return ""
    if field.shape == "boolean":
        return f"only to {'true' if field.tightens == 'up' else 'false'}"
    return "only severer" if field.choices else f"only {field.tightens}"


def facts(spec: PartSpec) -> Iterator[str]:
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


_INSTALL = "setuptools installs none without `package-data`"
_MOST_FILES = 200
"""The most files of a folder that are searched."""


def list_shipped() -> str:
    """List every library with its entries, then every mission."""
    blocks = ["\n".join(_contents(one)) for one in library.libraries()]
    shipped = library.missions()
    rows = map(str.rstrip, columns([(one.name, one.summary) for one in shipped], indent="  "))
    heading = "missions, for `kybflow new NAME --from`"
    why = f"installed without its YAML files ({_INSTALL})"
    missing = [f"{name}: {why}" for name in library.hollow()]
    return "\n\n".join([*blocks, "\n".join((heading, *rows)), *missing])


def _contents(one: library.Shipped) -> Iterator[str]:
    """Yield a line with a file's name and summary, then a line per section with its entries."""
    yield f"{one.name}  {one.summary}".rstrip()
    entries = one.entries()
    by_section = grouped((s, f"{name}{_signature(entry.value)}") for s, name, entry in entries)
    if one.root and one.root.get("parameters") is not None:
        by_section["with"] = [_signature(one.root)[1:-1]]
    for section, names in by_section.items():
        yield f"  {section:<9}  {', '.join(names)}"


def _signature(node: Node) -> str:
    """Return the parameters of a chain or library in brackets with their defaults; empty if there
    are none."""
    parameters = entries_of(node.get("parameters")) if isinstance(node, Mapping) else {}
    shown = []
    for name, entry in parameters.items():
        body = entry.value if isinstance(entry.value, Mapping) else None
        default = library.text_of(body.get("default")) if body else ""
        shown.append(f"{name} = {default}" if default else name)
    return f"({', '.join(shown)})" if shown else ""


def show_shipped(name: str) -> str | None:
    """Return the text of the library or mission called `name`, or of every library entry with that
    name; None if nothing has this name."""
    for one in (*library.libraries(), *library.missions()):
        if name in (one.name, one.name.removeprefix(f"{library.OWN}/")):
            return f"# {one.path}\n{one.source.text}".rstrip()
    found = [
        _entry_text(one, section, entry)
        for one in library.libraries()
        for section, own, entry in one.entries()
        if name in (own, f"{one.name}.{own}")
    ]
    return "\n\n".join(found) or None


def _entry_text(one: library.Shipped, section: str, entry: MappingEntry) -> str:
    """Return the lines of an entry. It ends where the YAML indentation does."""
    key = entry.key.span
    first, *rest = one.source.text.split("\n")[key.line - 1 : entry.value.span.end_line]
    inside = list(itertools.takewhile(lambda line: line[: key.column].isspace() or not line, rest))
    text = textwrap.dedent("\n".join([first, *inside])).rstrip()
    return f"# {section[:-1]} of {one.name}\n{text}"


def known_names() -> list[str]:
    known = [one.name for one in (*library.libraries(), *library.missions())]
    return known + [own for one in library.libraries() for _, own, _ in one.entries()]


def show_file(path: Path) -> str:
    """List the entries of the file at `path` and of its imports. Raises KybflowError."""
    one = library.read_file(str(path), path)
    if one.root is None:
        first = next(iter(one.source.found), None)
        texts = {one.source.file: one.source.text}
        raise KybflowError(
            render(first, texts) if first else f"`{path}` is not a mission or library"
        )
    blocks = ["\n".join(_contents(one))]
    for own in library.imports_of(one):
        heading = f"import {own.name}, {own.written}"
        if own.library is None:
            blocks.append(f"{heading}: no such library")
            continue
        _, *lines = _contents(own.library)
        blocks.append("\n".join([f"{heading}  {own.library.summary}".rstrip(), *lines]))
    return "\n\n".join(blocks)


def show_import(name: str) -> str | None:
    """Return a list of the library that is imported as `name`, or the text of its entry
    `name.ENTRY`. The import is searched in the missions of the current folder, then in the shipped
    ones; None if no mission has it."""
    alias, _, inner = name.partition(".")
    files = sorted(itertools.islice(Path().glob("*.yaml"), _MOST_FILES))
    here = (library.read_file(str(path), path) for path in files)
    for mission in itertools.chain(here, library.missions()):
        own = next((i.library for i in library.imports_of(mission) if i.name == alias), None)
        if own is None:
            continue
        if not inner:
            what = f"# `{alias}` in {mission.path.name}"
            return "\n".join([what, *_contents(own)])
        found = [_entry_text(own, s, e) for s, name, e in own.entries() if name == inner]
        if found:
            return "\n\n".join(found)
    return None
