"""The figure of behaviors and events over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any

from kybflow.runtime.report_data import Run, Visit
from kybflow.runtime.report_plot import Figure, time_axis

_VISITS = ("#6f9fd8", "#e3a869", "#6dbb9c", "#b892d4", "#d98a94", "#a9b35e", "#62bcc7", "#d395b6")
_GREY = "#9aa3ad"
_ALARMING = ("failed", "lost", "breached", "exceeded", "refused", "low", "failsafe_started")
_BARS = {"behavior_started", "behavior_ended", "phase_started", "phase_ended"}


def timeline(run: Run) -> Figure:
    """A row a vehicle and a flow: behaviors or phases as bars, events as marks below them."""
    visits = {track.name: track.visits for track in run.tracks} | _phases(run)
    rows = [*visits]
    if any(not event["vehicle"] for event in run.events):
        rows.append("run")
    colours = _visit_colours([visit for own in visits.values() for visit in own])
    traces = [
        _bar(visit, row, colours[visit.name])
        for row, own in enumerate(visits.values())
        for visit in own
    ]
    traces += _marks(run, rows)
    layout = {
        "xaxis": time_axis(run),
        "yaxis": {
            "tickvals": list(range(len(rows))),
            "ticktext": rows,
            "range": [len(rows) - 0.4, -0.7],
            "fixedrange": True,
            "showgrid": False,
        },
        "barmode": "overlay",
        "uniformtext": {"minsize": 9, "mode": "hide"},
        "height": 120 + 56 * len(rows),
        "hovermode": "closest",
        "showlegend": True,
    }
    note = "Bars are behaviors or phases; marks below are events. Hover for details; drag to zoom."
    return Figure("timeline", "Behaviors and events", note, traces, layout)


def _phases(run: Run) -> dict[str, list[Visit]]:
    """The phases of each flow, by the flow's row."""
    found: dict[str, list[Visit]] = {}
    for event in run.events:
        fields = event["fields"]
        if event["event"] == "phase_started":
            name, start = fields["phase"], event["t_s"]
            visit = Visit(name, "", start, run.end, "", aloft=False, built_in=False)
            found.setdefault(f"flow {fields['flow']}", []).append(visit)
        elif event["event"] == "phase_ended":
            visits = found[f"flow {fields['flow']}"]
            visits[-1] = replace(visits[-1], end=event["t_s"], ended=fields["how"])
    return found


def _visit_colours(visits: Sequence[Visit]) -> dict[str, str]:
    """A colour for each name; what no mission wrote is grey."""
    own = dict.fromkeys(visit.name for visit in visits if not visit.built_in)
    colours = {name: _VISITS[number % len(_VISITS)] for number, name in enumerate(own)}
    return {visit.name: colours.get(visit.name, _GREY) for visit in visits}


def _bar(visit: Visit, row: int, colour: str) -> dict[str, Any]:
    part = f" ({visit.part})" if visit.part and visit.part != visit.name else ""
    ended = f"<br>ended: {visit.ended}" if visit.ended else ""
    span = f"{visit.start:.2f} to {visit.end:.2f} s"
    return {
        "type": "bar",
        "orientation": "h",
        "x": [visit.end - visit.start],
        "base": [visit.start],
        "y": [row],
        "width": 0.5,
        "text": [visit.name],
        "textposition": "inside",
        "insidetextanchor": "middle",
        "insidetextfont": {"color": "#10151b"},
        "marker": {"color": colour, "line": {"color": "paper", "width": 1}},
        "hovertemplate": f"<b>{visit.name}</b>{part}<br>{span}{ended}<extra></extra>",
        "showlegend": False,
    }


def _marks(run: Run, rows: list[str]) -> list[dict[str, Any]]:
    """Two traces of marks. What was told of one vehicle at one time shares a mark."""
    quiet: dict[tuple[float, int], list[str]] = {}
    alarming: dict[tuple[float, int], list[str]] = {}
    for event in run.events:
        vehicle = event["vehicle"] or "run"
        if event["event"] not in _BARS and vehicle in rows:
            marks = alarming if event["event"].endswith(_ALARMING) else quiet
            marks.setdefault((event["t_s"], rows.index(vehicle)), []).append(_told(event))
    kinds = (("event", quiet, "triangle-up", "ink"), ("alarm", alarming, "diamond", "alarm"))
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": name,
            "x": [time for time, _ in marks],
            "y": [row + 0.38 for _, row in marks],
            "text": ["<br>".join(told) for told in marks.values()],
            "hovertemplate": "<b>%{x:.2f} s</b><br>%{text}<extra></extra>",
            "marker": {"symbol": symbol, "color": colour, "size": 9},
        }
        for name, marks, symbol, colour in kinds
        if marks
    ]


def _told(event: dict[str, Any]) -> str:
    fields = ", ".join(
        f"{name}: {escape(str(value))}"
        for name, value in event["fields"].items()
        if value is not None
    )
    place = f" ({escape(event['at'])})" if event["at"] else ""
    return f"{event['event']}{' - ' if fields else ''}{fields}{place}"
