"""Formats a rehearsal as text for people, as JSON, and as a line of the preflight checks."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from kybflow.dsl.diagnostics import Severity, render_all, to_json

if TYPE_CHECKING:
    from kybflow.api.rehearsal.rehearse import Rehearsal
    from kybflow.runtime.preflight import PreflightResult


def formatted(rehearsal: Rehearsal, texts: dict[str, str], format: str) -> Iterable[str]:
    """Return a rehearsal's texts in a format: `text`, `json`, `sarif` or `github`."""
    from kybflow.api.findings.formats import to_annotation, to_sarif

    if format == "text":
        return reports(rehearsal, texts)
    if format == "json":
        return [_as_json(rehearsal)]
    if format == "sarif":
        return [to_sarif(rehearsal.diagnostics)]
    return map(to_annotation, rehearsal.diagnostics)


def reports(rehearsal: Rehearsal, texts: dict[str, str]) -> Iterator[str]:
    """Yield a text for each finding and each assumed event, then a line of figures."""
    yield from render_all(rehearsal.diagnostics, texts)
    for seconds, name, waiting in rehearsal.assumed:
        yield f"assumed: a person gives `{name}` at {seconds:.1f} s, for which {waiting} waits"
    yield f"{rehearsal.mission} rehearsed: {_figures(rehearsal)}"


def _figures(rehearsal: Rehearsal) -> str:
    """Return the duration, least separation, least charge and number of findings, as a line of
    text."""
    words = [f"{rehearsal.duration:.1f} s"]
    if rehearsal.separation is not None:
        metres, seconds, (one, other) = rehearsal.separation
        words.append(f"`{one}` and `{other}` {metres:.2f} m apart at least ({seconds:.1f} s)")
    if rehearsal.charge is not None:
        words.append(f"battery of `{rehearsal.charge.vehicle}` {rehearsal.charge.remaining:.0%}")
    count = len(rehearsal.diagnostics)
    words += [f"{count} finding{'s' * (count > 1)}"] if count else []
    return ", ".join(words)


def preflight_line(rehearsal: Rehearsal) -> PreflightResult:
    from kybflow.runtime.preflight import PreflightResult

    errors = [d for d in rehearsal.diagnostics if d.severity is Severity.ERROR]
    if not errors:
        return PreflightResult("all", "rehearsal", True, _figures(rehearsal))
    more = f", and {len(errors) - 1} more" if len(errors) > 1 else ""
    reason = f"{errors[0].message}{more}: see `kybflow rehearse`"
    return PreflightResult("all", "rehearsal", False, reason, errors[0].span.at)


def _as_json(rehearsal: Rehearsal) -> str:
    separation, charge = rehearsal.separation, rehearsal.charge
    whole: dict[str, Any] = {
        "kybflow": 1,
        "mission": rehearsal.mission,
        "target": rehearsal.target,
        "clean": rehearsal.is_clean,
        "duration_s": round(rehearsal.duration, 3),
        "separation": None if separation is None else separation._asdict(),
        "battery": None if charge is None else charge._asdict(),
        "assumed": [one._asdict() for one in rehearsal.assumed],
        "diagnostics": [to_json(d) for d in rehearsal.diagnostics],
    }
    return json.dumps(whole, indent=2)
