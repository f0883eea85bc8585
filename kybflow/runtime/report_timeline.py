"""The figure of behaviors and events over time."""

from __future__ import annotations

from html import escape
from typing import Any

from kybflow.runtime.report_data import Run, Visit
from kybflow.runtime.report_plot import Figure, time_axis

_VISITS = ("#6f9fd8", "#e3a869", "#6dbb9c", "#b892d4", "#d98a94", "#a9b35e", "#62bcc7", "#d395b6")
_BUILT_IN = {"landed", "brake", "hover", "auto_land", "land_blind", "fault"}
_GREY = "#9aa3ad"
_ALARMING = ("failed", "lost", "breached", "exceeded", "refused", "low", "failsafe_started")
_BARS = {"behavior_started", "behavior_ended"}


def timeline(run: Run) -> Figure:
    """A row a vehicle: its behaviors as bars, its events as marks below them."""
    rows = [track.name for track in run.tracks]
    if any(not event["vehicle"] for event in run.events):
        rows.append("run")
    colours = _visit_colours(run)
    traces = [
        _bar(visit, row, colours[visit.name])
        for row, track in enumerate(run.tracks)
        for visit in track.visits
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
    note = "Bars are behaviors; marks below them are events. Hover for details; drag to zoom."
    return Figure("timeline", "Behaviors and events", note, traces, layout)


def _visit_colours(run: Run) -> dict[str, str]:
    names = list(dict.fromkeys(visit.name for track in run.tracks for visit in track.visits))
    own = [name for name in names if name not in _BUILT_IN]
    colours = {name: _VISITS[number % len(_VISITS)] for number, name in enumerate(own)}
    return {name: colours.get(name, _GREY) for name in names}


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
    quiet: list[dict[str, Any]] = []
    alarming: list[dict[str, Any]] = []
    for event in run.events:
        if event["event"] not in _BARS and (event["vehicle"] or "run") in rows:
            (alarming if event["event"].endswith(_ALARMING) else quiet).append(event)
    kinds = (("event", quiet, "triangle-up", "ink"), ("alarm", alarming, "diamond", "alarm"))
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": name,
            "x": [event["t_s"] for event in events],
            "y": [rows.index(event["vehicle"] or "run") + 0.38 for event in events],
            "text": [_told(event) for event in events],
            "hovertemplate": "%{text}<extra></extra>",
            "marker": {"symbol": symbol, "color": colour, "size": 9},
        }
        for name, events, symbol, colour in kinds
        if events
    ]


def _told(event: dict[str, Any]) -> str:
    lines = [f"<b>{event['event']}</b> at {event['t_s']:.2f} s"]
    lines += [f"{name}: {escape(str(value))}" for name, value in event["fields"].items()]
    if event["at"]:
        lines.append(event["at"])
    return "<br>".join(lines)
