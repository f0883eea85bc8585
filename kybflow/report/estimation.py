"""The estimators in a report: their figures, when they took turns, and a page for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from kybflow.core.units import DEG
from kybflow.report.data import Run
from kybflow.report.estimator_figures import (
    age_figure,
    attitude_figure,
    error_figure,
    is_simulated,
)
from kybflow.report.estimators import SURE, Estimated, figures_of
from kybflow.report.pictures import Picture, pictures
from kybflow.report.plot import Figure
from kybflow.report.tables import table

_FEW = 6
"""Pages that are open at once."""
_DASH = "\N{EN DASH}"
_HEADS = (
    "Vehicle", "Estimator", "In use", "Off mean", "99 %", "max (cm)",
    f"Within {SURE:.1f} spreads", "Yaw 99 % (deg)", "Age mean", "max (ms)",
)  # fmt: skip
_CHANGES = ("Time (s)", "Vehicle", "From", "To", "Why", "Apart (cm)")


@dataclass(frozen=True)
class Page:
    """One estimator's."""

    estimated: Estimated
    figures: tuple[Figure, ...]
    pictures: tuple[Picture, ...]


def pages(run: Run) -> list[Page]:
    """A page for each estimator that was recorded."""
    named = [estimated for estimated in run.estimators if estimated.name]
    return [
        Page(
            estimated,
            (
                error_figure(run, estimated, f"estimator_{n}"),
                attitude_figure(run, estimated, f"estimator_{n}"),
                age_figure(run, estimated, f"estimator_{n}"),
            ),
            tuple(
                picture
                for picture in run.pictures
                if (picture.vehicle, picture.estimator) == (estimated.vehicle, estimated.name)
            ),
        )
        for n, estimated in enumerate(named)
    ]


def estimators(run: Run, shown: Sequence[Page]) -> str:
    """The section of estimators; nothing where none was recorded."""
    if not shown:
        return ""
    rows = [_row(run, estimated) for estimated in run.estimators if _is_told(run, estimated)]
    what = (
        "the true position"
        if is_simulated(run)
        else "what the vehicle flew on; nobody knows better"
    )
    note = (
        f'<p class="note">While it was in use: how far it was off, from {what}; how many of these '
        f"errors were within {SURE:.1f} spreads, 95 % if the spread is honest (what was flown on "
        "counts only where no offset was being taken away, which no spread tells); what 99 % of "
        "its errors in yaw were below; how old its newest measurement was.</p>"
    )
    body = table(_HEADS, rows, numbers=range(2, 10))
    folded = "".join(_page(page, len(shown)) for page in shown)
    return f"<section><h2>Estimators</h2>{note}{body}{_changes(run)}</section>{folded}"


def _is_told(run: Run, estimated: Estimated) -> bool:
    """What was flown on is a line of its own where that could be more than one estimator."""
    others = [e for e in run.estimators if e.vehicle == estimated.vehicle and e.name]
    return bool(estimated.name) or len(others) > 1


def _row(run: Run, estimated: Estimated) -> list[str]:
    ticks = next(e for e in run.estimators if e.vehicle == estimated.vehicle and not e.name)
    found = figures_of(estimated, len(ticks.time))
    known = is_simulated(run)
    return [
        escape(estimated.vehicle),
        escape(estimated.name) or "<i>what it flew on</i>",
        f"{found.share * 100.0:.1f} %",
        *(_scaled(value if known else None, 100.0) for value in (found.mean, found.high)),
        _scaled(found.worst if known else None, 100.0),
        _DASH if found.within is None or not known else f"{found.within * 100.0:.1f} %",
        _scaled(found.yaw if known else None, 1.0 / DEG),
        *(_scaled(value, 1000.0, 0) for value in (found.age, found.oldest)),
    ]


def _changes(run: Run) -> str:
    """When one took over from another, and why."""
    rows = []
    for event in run.events:
        fields: dict[str, Any] = event["fields"]
        is_change = event["event"] in ("estimator_changed", "estimator_lost")
        if not is_change or fields["reason"] == "the first estimate":
            continue
        apart = fields.get("offset") if fields.get("previous") else None
        rows.append(
            [
                f"{event['t_s']:.2f}",
                escape(event["vehicle"]),
                escape(fields.get("previous") or "none"),
                escape(fields.get("estimator") or "none"),
                _code(fields["reason"]),
                _scaled(apart, 100.0),
            ]
        )
    if not rows:
        return ""
    body = table(_CHANGES, rows, numbers=(0, 5))
    count = "1 change" if len(rows) == 1 else f"{len(rows)} changes"
    return f"<details open><summary>{count}</summary>{body}</details>"


def _page(page: Page, count: int) -> str:
    """Folded up where there are many, or where it is the only one and nothing happened."""
    estimated = page.estimated
    title = f"{escape(estimated.vehicle)}: {escape(estimated.name)}"
    opened = " open" if count <= _FEW and (count > 1 or page.pictures) else ""
    body = "".join(
        f'<h3>{escape(figure.title)}</h3><p class="note">{escape(figure.note)}</p>'
        f'<div class="figure" id="{figure.name}"></div>'
        for figure in page.figures
    )
    shown = pictures(page.pictures)
    return f'<details class="page"{opened}><summary>{title}</summary>{body}{shown}</details>'


def _scaled(value: float | None, factor: float, digits: int = 2) -> str:
    return _DASH if value is None else f"{value * factor:.{digits}f}"


def _code(text: str) -> str:
    """Text in which names stand between backticks, as HTML."""
    parts = escape(text).split("`")
    return "".join(f"<code>{part}</code>" if n % 2 else part for n, part in enumerate(parts))
