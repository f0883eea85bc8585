"""The words and tables of a report: outcome, facts, expectations, vehicles, behaviors."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from kybflow.core.units import format_measured
from kybflow.report.data import Run
from kybflow.report.endings import ended

_OUTCOMES = {
    "succeeded": "✓ succeeded",
    "failed": "✗ failed",
    "interrupted": "✗ interrupted",
    "driver_failed": "✗ driver failed",
}
_DASH = "\N{EN DASH}"
_FEW_VISITS = 16


def badge(run: Run) -> str:
    """The outcome as a word on a coloured ground."""
    outcome = run.summary.get("outcome", "")
    kind = "good" if outcome == "succeeded" else "bad"
    return f'<span class="badge {kind}">{_OUTCOMES.get(outcome, "✗ not finished")}</span>'


def facts(run: Run) -> str:
    """What was run, and how fast."""
    summary, versions = run.summary, run.provenance.get("versions", {})
    factor = summary.get("real_time_factor")
    found = [
        ("Target", run.mission.get("target", _DASH)),
        ("Vehicles", str(len(run.tracks))),
        ("Seed", str(run.provenance.get("seed", _DASH))),
        ("Flown", f"{summary.get('sim_time_s', run.end):.1f} s"),
        ("Real-time factor", f"{factor:.3g} x" if factor is not None else _DASH),
        ("Control", f"{run.mission.get('control_rate', _DASH)} Hz"),
        ("kybflow", versions.get("kybflow", _DASH)),
    ]
    return "".join(f"<div><dt>{name}</dt><dd>{escape(text)}</dd></div>" for name, text in found)


def expectations(run: Run) -> str:
    """Each line of `expect:`, whether it held, and by how much."""
    lines = run.summary.get("expectations", [])
    if not lines:
        return ""
    rows = [
        [
            _verdict(line["held"]),
            f"<code>{escape(line['text'])}</code>",
            _quantity(line["value"], line.get("unit", "")),
            _quantity(line.get("margin"), line.get("unit", ""), sign="+"),
            f"<code>{escape(line['at'])}</code>",
        ]
        for line in lines
    ]
    held = sum(line["held"] for line in lines)
    heads = ("", "Expectation", "Value", "Margin", "Mission")
    body = table(heads, rows, numbers=(2, 3))
    return f"<section><h2>Expectations: {held} of {len(lines)} held</h2>{body}</section>"


def vehicles(run: Run) -> str:
    """The figures of each vehicle, and of each visit to a state."""
    found: dict[str, dict[str, Any]] = run.summary.get("vehicles", {})
    if not found:
        return ""
    rows = [
        [
            escape(name),
            escape(ended(run, name, vehicle)),
            escape(_estimators(vehicle["estimators"])),
            *_errors(vehicle),
            _percent(vehicle["min_battery"]),
        ]
        for name, vehicle in found.items()
    ]
    heads = ("Vehicle", "Ended", "Estimators", *_ERROR_HEADS, "Lowest battery")
    body = table(heads, rows, numbers=range(3, 10))
    return f"<section><h2>Vehicles</h2>{body}{_visits(found)}</section>"


def footer(run: Run) -> str:
    """Where it all came from."""
    sources = ", ".join(
        f"<code>{escape(source['path'])}</code> ({source['sha256'][:12]})"
        for source in run.provenance.get("sources", [])
    )
    versions = run.provenance.get("versions", {})
    packages = ", ".join(f"{escape(name)} {escape(number)}" for name, number in versions.items())
    started, machine = run.provenance.get("started", ""), run.provenance.get("machine", {})
    system = machine.get("system", "")
    lines = [f"Started {escape(started)}" if started else "", escape(system), packages, sources]
    return "<br>".join(line for line in lines if line)


_ERROR_HEADS = (
    "Position mean", "rms", "max (cm)", "Velocity mean", "rms", "max (cm/s)",
)  # fmt: skip


def _visits(found: dict[str, dict[str, Any]]) -> str:
    rows = [
        [
            escape(name),
            escape(visit["name"]),
            f"{visit['start_s']:.2f}",
            _DASH if visit["end_s"] is None else f"{visit['end_s']:.2f}",
            escape(visit["ended"] or _DASH),
            *_errors(visit),
        ]
        for name, vehicle in found.items()
        for visit in vehicle["behaviors"]
    ]
    heads = ("Vehicle", "Behavior", "From (s)", "To (s)", "Ended", *_ERROR_HEADS)
    body = table(heads, rows, numbers=(2, 3, *range(5, 11)))
    opened = " open" if len(rows) <= _FEW_VISITS else ""
    return f"<details{opened}><summary>Errors by behavior</summary>{body}</details>"


def _errors(record: dict[str, Any]) -> list[str]:
    cells = []
    for field in ("position_error_m", "velocity_error_m_s"):
        errors = record[field] or {}
        for figure in ("mean", "rms", "max"):
            value = errors.get(figure)
            cells.append(_DASH if value is None else f"{value * 100.0:.2f}")
    return cells


def _estimators(uses: Sequence[dict[str, Any]]) -> str:
    named = [f"{use['name'] or 'none'} from {use['start_s']:.1f} s" for use in uses]
    return ", ".join(named) or _DASH


def _verdict(held: bool) -> str:
    return '<span class="good">✓ held</span>' if held else '<span class="bad">✗ broken</span>'


def _percent(value: float | None) -> str:
    return _DASH if value is None else f"{value * 100.0:.1f} %"


def _quantity(value: float | None, unit: str, sign: str = "") -> str:
    """A value in SI as a person would write it; a dash for none."""
    if value is None:
        return _DASH
    return format_measured(value, unit, sign).replace("-", "\N{MINUS SIGN}")


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int]) -> str:
    """Rows of HTML cells under their heads; the columns `numbers` are right-aligned."""
    marks = ['class="number"' if column in numbers else "" for column in range(len(heads))]
    head = "".join(f"<th {mark}>{text}</th>" for mark, text in zip(marks, heads, strict=True))
    body = "".join(
        "<tr>"
        + "".join(f"<td {mark}>{cell}</td>" for mark, cell in zip(marks, row, strict=True))
        + "</tr>"
        for row in rows
    )
    return f'<div class="table"><table><tr>{head}</tr>{body}</table></div>'
