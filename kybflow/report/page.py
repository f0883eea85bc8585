"""Writes `report.html` from a run folder. The page needs no network and no other file; its design
is in `templates/`."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

from kybflow.core.units import DEG, format_measured
from kybflow.recording.appearance import COLLISION, EVENT, fields_text, kind_of
from kybflow.recording.run_folder import REPORT, write_file
from kybflow.report.data import Picture, RecordedRun, read_run
from kybflow.report.estimator_pages import CHI_95, estimator_pages, statistics
from kybflow.report.events import ending, is_notable
from kybflow.report.figures import figures
from kybflow.report.plot import Figure

_DASH = "\N{EN DASH}"


def write_report(folder: Path) -> Path:
    """Write the report of the run in `folder` and return its path. Raises RunFolderError if the run
    can't be read, RunUnwritten if the page can't be written."""
    page, path = render(read_run(folder)), folder / REPORT
    write_file(path, page)
    return path


def render(run: RecordedRun) -> str:
    drawn, pages = figures(run), estimator_pages(run)
    every = [*drawn, *(figure for page in pages for figure in page.figures)]
    notable = sorted(filter(is_notable, run.events), key=lambda e: kind_of(e) != COLLISION)
    return rendered(
        "page.html",
        every,
        run=run,
        DEG=DEG,
        spreads=f"{CHI_95:.1f}",
        ending=ending,
        figures=drawn,
        statistics=list(statistics(run)),
        pages=pages,
        notable=notable,
        fields_text=fields_text,
    )


def rendered(template: str, drawn: Iterable[Figure], **values: Any) -> str:
    """Return a page that needs no other file. drawn: all its figures. values: of its template."""
    environment = Environment(
        loader=PackageLoader("kybflow.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests.update(change=is_change, plain=lambda event: kind_of(event) == EVENT)
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    environment.filters.update(
        code=code, errors=errors, picture=picture, quantity=quantity, scaled=scaled
    )
    data = [asdict(figure) for figure in drawn]
    return environment.get_template(template).render(
        DASH=_DASH, plotly=get_plotlyjs(), data=data, **values
    )


def is_change(event: dict[str, Any]) -> bool:
    """Return whether an event changes the estimator during the flight."""
    is_one = event["event"] in ("estimator_changed", "estimator_lost")
    return is_one and event["fields"]["reason"] != "the first estimate"


def scaled(value: float | None, factor: float = 1.0, digits: int = 2, unit: str = "") -> str:
    """Format a number times `factor`; None becomes a dash."""
    return _DASH if value is None else f"{value * factor:.{digits}f}{unit}"


def quantity(value: float | None, unit: str, sign: str = "") -> str:
    """Format a value given in SI units; None becomes a dash."""
    if value is None:
        return _DASH
    return format_measured(value, unit, sign).replace("-", "\N{MINUS SIGN}")


def errors(record: dict[str, Any]) -> list[str]:
    """Format the mean, rms and largest position error in cm, then those of the velocity in cm/s."""
    return [
        scaled((record[field] or {}).get(figure), 100.0)
        for field in ("position_error_m", "velocity_error_m_s")
        for figure in ("mean", "rms", "max")
    ]


def code(text: str) -> Markup:
    """Return text as HTML, with the names between backticks as code."""
    parts = escape(text).split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if n % 2 else part for n, part in enumerate(parts)
    )


def picture(picture: Picture) -> dict[str, str]:
    """Return a picture with its caption and encoded data."""
    if picture.used is None:
        found = "no pose"
    else:
        found = f"{picture.used} {'tag' if picture.used == 1 else 'tags'} used"
        found += f", {picture.rejected} rejected" if picture.rejected else ""
    return {
        "camera": picture.camera,
        "caption": f"{picture.time:.2f} s: {found}",
        "data": base64.b64encode(picture.data).decode(),
    }
