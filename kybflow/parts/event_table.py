"""The table of events in docs/parts.md."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

from kybflow.core.events import BaseEvent, RunEvent
from kybflow.core.sources import help_of, hints_of
from kybflow.core.units import Dimension
from kybflow.parts.catalog import Catalog
from kybflow.parts.events import ENGINE_EVENTS

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
