"""The tables of events: what was out of the ordinary, and everything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import PurePath
from typing import Any

from kybflow.report.data import Run
from kybflow.report.marks import COLLISION, EVENT, is_notable, kind_of, told
from kybflow.report.tables import table

_MANY = 40
"""Notable events from which their table is folded up."""
_HEADS = ("Time (s)", "Vehicle", "Event", "What", "Mission")


def events(run: Run) -> str:
    """The notable events, collisions first, and folded up under them all events in order."""
    if not run.events:
        return ""
    notable = sorted(filter(is_notable, run.events), key=lambda e: kind_of(e) != COLLISION)
    opened = " open" if len(notable) <= _MANY else ""
    shown = (
        f"<details{opened}><summary>{len(notable)} out of the ordinary</summary>"
        f"{_table(notable)}</details>"
        if notable
        else '<p class="note">None out of the ordinary.</p>'
    )
    every = f"<details><summary>All {len(run.events)}</summary>{_table(run.events)}</details>"
    return f'<section class="events"><h2>Events</h2>{shown}{every}</section>'


def _table(found: Sequence[Mapping[str, Any]]) -> str:
    return table(_HEADS, [_row(event) for event in found], numbers=(0,))


def _row(event: Mapping[str, Any]) -> list[str]:
    name, at = escape(event["event"]), event["at"]
    place = f'<code title="{escape(at)}">{escape(PurePath(at).name)}</code>' if at else ""
    return [
        f"{event['t_s']:.2f}",
        escape(event["vehicle"]),
        name if kind_of(event) == EVENT else f'<span class="bad">{name}</span>',
        escape(told(event)),
        place,
    ]
