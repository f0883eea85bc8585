"""A rehearsal as text for people and for programs, and as a line of the preflight."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from kybflow.dsl.diagnostics.diagnostic import Severity
from kybflow.dsl.diagnostics.render import render_all, to_json

if TYPE_CHECKING:
    from kybflow.api.rehearsal.rehearse import Rehearsal
    from kybflow.runtime.preflight import PreflightResult


def told(rehearsal: Rehearsal, texts: dict[str, str], format: str) -> Iterable[str]:
    """What came of a rehearsal, in the format `text`, `json`, `sarif` or `github`."""
    from kybflow.api.findings.formats import to_annotation, to_sarif

    if format == "text":
        return reports(rehearsal, texts)
    if format == "json":
        return [as_json(rehearsal)]
    if format == "sarif":
        return [to_sarif(rehearsal.diagnostics)]
    return map(to_annotation, rehearsal.diagnostics)


def reports(rehearsal: Rehearsal, texts: dict[str, str]) -> Iterator[str]:
    """A text for each finding, then what was assumed, then the figures."""
    yield from render_all(rehearsal.diagnostics, texts)
    for seconds, name, waiting in rehearsal.assumed:
        yield f"assumed: a person gives `{name}` at {seconds:.1f} s, for which {waiting} waits"
    yield f"{rehearsal.mission} rehearsed: {figures(rehearsal)}"


def figures(rehearsal: Rehearsal) -> str:
    """How long it took, and the least of what must not be too little."""
    said = [f"{rehearsal.duration:.1f} s"]
    if rehearsal.separation is not None:
        metres, seconds, (one, other) = rehearsal.separation
        said.append(f"`{one}` and `{other}` {metres:.2f} m apart at least ({seconds:.1f} s)")
    if rehearsal.charge is not None:
        said.append(f"battery of `{rehearsal.charge.vehicle}` {rehearsal.charge.remaining:.0%}")
    count = len(rehearsal.diagnostics)
    said += [f"{count} finding{'s' * (count > 1)}"] if count else []
    return ", ".join(said)


def preflight_line(rehearsal: Rehearsal) -> PreflightResult:
    """The line of the preflight."""
    from kybflow.runtime.preflight import PreflightResult

    errors = [d for d in rehearsal.diagnostics if d.severity is Severity.ERROR]
    if not errors:
        return PreflightResult("all", "rehearsal", True, figures(rehearsal))
    more = f", and {len(errors) - 1} more" if len(errors) > 1 else ""
    reason = f"{errors[0].message}{more}: see `kybflow rehearse`"
    return PreflightResult("all", "rehearsal", False, reason, errors[0].span.at)


def as_json(rehearsal: Rehearsal) -> str:
    """All of it for programs."""
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
