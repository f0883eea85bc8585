"""`kybflow parts`: what parts there are, and what one does."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.params import Field, type_of
from kybflow.dsl.diagnostics.diagnostic import did_you_mean
from kybflow.dsl.reading.values import bounds_of, shown_value
from kybflow.parts.catalog import Catalog, PartSpec


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
    """What to say of a name that no part has."""
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
