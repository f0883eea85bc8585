"""Writes `report.html`: one page with everything in it, made from a run folder alone.

It needs no network and no other file. How the page looks stands in `report_page.html`.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from plotly.offline import get_plotlyjs

from kybflow.recording.run_folder import REPORT, RunFolderError
from kybflow.report.data import Run, read_run
from kybflow.report.estimation import estimators, pages
from kybflow.report.events import events
from kybflow.report.figures import figures
from kybflow.report.plot import Figure
from kybflow.report.tables import badge, expectations, facts, footer, vehicles

_PAGE = "report_page.html"


def write_report(folder: Path) -> Path:
    """Make the report of the run in `folder`; returns its path.

    Raises RunFolderError where the run can't be read or the page can't be written.
    """
    page, path = render(read_run(folder)), folder / REPORT
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"`{path}` can't be written: {error.strerror or error}") from error
    return path


def render(run: Run) -> str:
    """The whole page."""
    drawn, of_estimators = figures(run), pages(run)
    every = [figure for page in of_estimators for figure in page.figures]
    reason = run.summary.get("reason")
    template = Template(files("kybflow.runtime").joinpath(_PAGE).read_text(encoding="utf-8"))
    return template.substitute(
        mission=escape(run.mission.get("mission", "a run")),
        summary=escape(run.mission.get("summary", "")),
        badge=badge(run),
        reason=f'<p class="reason">{escape(reason)}</p>' if reason else "",
        facts=facts(run),
        expectations=expectations(run),
        vehicles=vehicles(run),
        figures="\n".join(_section(figure) for figure in drawn),
        estimators=estimators(run, of_estimators),
        events=events(run),
        footer=footer(run),
        plotly=get_plotlyjs(),
        data=_data([asdict(figure) for figure in (*drawn, *every)]),
    )


def _section(figure: Figure) -> str:
    note = f'<p class="note">{escape(figure.note)}</p>' if figure.note else ""
    title = f"<h2>{escape(figure.title)}</h2>"
    return f'<section>{title}{note}<div class="figure" id="{figure.name}"></div></section>'


def _data(value: list[dict[str, Any]]) -> str:
    """JSON that can't end the script element that it stands in."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
