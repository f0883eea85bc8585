"""The figure of behaviors and events over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any

from kybflow.recording.appearance import ALARM, COLLISION, EVENT, fields_text, kind_of
from kybflow.report import events
from kybflow.report.data import RecordedRun, StateVisit
from kybflow.report.plot import Figure, markers, time_axis

_MARKERS = {
    EVENT: {"symbol": "triangle-up", "color": "ink", "size": 9},
    ALARM: {"symbol": "diamond", "color": "alarm", "size": 9},
    COLLISION: {"symbol": "x", "color": "alarm", "size": 13},
}
_VISITS = ("#6f9fd8", "#e3a869", "#6dbb9c", "#b892d4", "#d98a94", "#a9b35e", "#62bcc7", "#d395b6")
_GREY = "#9aa3ad"
"""The colour of built-in states."""
_BAR, _LANE, _MARKS, _GAP, _LEVEL = 28.0, 15.0, 20.0, 14.0, 13.0
"""Heights in pixels: of a bar, of a lane, of the room for marks below a bar, of the gap between
rows, and of a level of labels."""
_LEVELS, _WIDTH, _LETTER = 3, 920.0, 6.6
"""The number of label levels above a bar; the widths of the time axis and of a letter, in pixels.
"""
_NOTE = (
    "Bars are behaviors or phases; marks below them are events, as in the table of events. Hover "
    "for details; drag to zoom."
)


def timeline(run: RecordedRun) -> Figure:
    """Draw a row for each vehicle and flow: its behaviors or phases as bars, and events as marks
    below. Under a vehicle's row, its faults, holds, clamps and estimators have a lane each, if
    there are any. The y axis counts pixels from the top."""
    visits = {track.name: track.visits for track in run.tracks} | _phases(run)
    shown = [visit for own in visits.values() for visit in own]
    names = dict.fromkeys(visit.name for visit in shown if not visit.built_in)
    colours = {name: _VISITS[number % len(_VISITS)] for number, name in enumerate(names)}
    traces: list[dict[str, Any]] = []
    labels: list[dict[str, Any]] = []
    marked: dict[str, float] = {}
    ticks: dict[str, float] = {}
    down = 0.0
    lanes = _lanes(run)
    for row, own in visits.items():
        texts, above = narrow_labels(own, max(run.end, 0.1))
        middle = down + above + _BAR / 2
        ticks[row], marked[row] = middle, middle + _BAR / 2 + 9.0
        traces += [_visit(v, middle, colours.get(v.name, _GREY), v not in texts) for v in own]
        labels += [_label(v, middle - _BAR / 2, level) for v, level in texts.items()]
        down = middle + _BAR / 2 + _MARKS
        for kind, intervals in lanes.get(row, {}).items():
            ticks[f"{row}, {kind}"] = down + _LANE / 2
            traces += [_interval(interval, down + _LANE / 2) for interval in intervals]
            down += _LANE + 3.0
        down += _GAP
    if any(not event["vehicle"] for event in run.events):
        marked["run"] = ticks["run"] = down
        down += 2 * _GAP
    traces += marks(run, marked)
    layout = {
        "xaxis": time_axis(run),
        "yaxis": {
            "tickvals": list(ticks.values()),
            "ticktext": list(ticks),
            "range": [down, -6.0],
            "fixedrange": True,
            "showgrid": False,
            "zeroline": False,
        },
        "annotations": labels,
        "barmode": "overlay",
        "uniformtext": {"minsize": 9, "mode": "hide"},
        "height": round(100 + down),
        "hovermode": "closest",
        "showlegend": True,
    }
    return Figure("timeline", "Behaviors and events", _NOTE, traces, layout)


def marks(run: RecordedRun, rows: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return a trace for each kind of mark. Events of one vehicle at the same time share a mark.
    rows: the y coordinates of the marks, by vehicle and for the `run`."""
    found: dict[str, dict[tuple[float, float], list[str]]] = {kind: {} for kind in _MARKERS}
    for event in run.events:
        row = event["vehicle"] or "run"
        if event["event"] not in events.BARS and row in rows:
            place = (event["t_s"], rows[row])
            fields = fields_text(event)
            at = f" ({escape(event['at'])})" if event["at"] else ""
            text = f"{event['event']}{' - ' if fields else ''}{escape(fields)}{at}"
            found[kind_of(event)].setdefault(place, []).append(text)
    traces = []
    for kind, places in found.items():
        if places:
            x, y = map(list, zip(*places, strict=True))
            texts = ["<br>".join(of) for of in places.values()]
            hover = "<b>%{x:.2f} s</b><br>%{text}"
            traces.append(markers(kind, x, y, _MARKERS[kind], hover, text=texts))
    return traces


def narrow_labels(visits: Sequence[StateVisit], end: float) -> tuple[dict[StateVisit, int], float]:
    """Place the names that don't fit into their visit's bar on levels above the bars. Return each
    such visit's level, and the height of all levels in pixels. A name that fits on no level is left
    out."""
    each = _WIDTH / end
    free = [float("-inf")] * _LEVELS
    levels: dict[StateVisit, int] = {}
    for visit in visits:
        width = _LETTER * len(visit.name) + 6.0
        if (visit.end - visit.start) * each >= width:
            continue
        left = (visit.start + visit.end) / 2 * each - width / 2
        level = next((n for n in range(_LEVELS) if free[n] <= left), None)
        if level is not None:
            free[level] = left + width
            levels[visit] = level
    return levels, _LEVEL * (max(levels.values(), default=-1) + 1) + 4.0


def _lanes(run: RecordedRun) -> dict[str, dict[str, list[events.Interval]]]:
    """Return the lanes of each vehicle. There is no lane for a single estimator."""
    found: dict[str, dict[str, list[events.Interval]]] = {}
    lasting = events.faults_and_holds(run)
    for name, used in events.estimators_in_use(run).items():
        own = [i for i in lasting if i.vehicle == name]
        lanes = {
            "faults": [i for i in own if i.kind == events.FAULT],
            "holds": [i for i in own if i.kind == events.HOLD],
            "clamps": [i for i in own if i.kind == events.CLAMP],
            "estimator": used if len(used) > 1 else [],
        }
        found[name] = {kind: shown for kind, shown in lanes.items() if shown}
    return found


def _label(visit: StateVisit, top: float, level: int) -> dict[str, Any]:
    """Return a visit's name above its bar, with a line down to the bar."""
    return {
        "text": visit.name,
        "x": (visit.start + visit.end) / 2,
        "y": top,
        "ax": 0,
        "ay": -9.0 - _LEVEL * level,
        "arrowhead": 0,
        "arrowwidth": 0.8,
        "arrowcolor": "#8a94a0",
        "font": {"size": 10, "color": "ink"},
        "yshift": 0,
    }


_Span = events.Interval | StateVisit


def _bar(
    span: _Span, middle: float, width: float, text: str, title: str, more: str = ""
) -> dict[str, Any]:
    """Return a bar with a text inside. title, more: the text of its hover label before and after
    the times."""
    time = f"{span.start:.2f} to {span.end:.2f} s"
    return {
        "type": "bar",
        "orientation": "h",
        "x": [span.end - span.start],
        "base": [span.start],
        "y": [middle],
        "width": width,
        "text": [text],
        "textposition": "inside",
        "hovertemplate": f"{title}<br>{time}{more}<extra></extra>",
        "showlegend": False,
    }


def _interval(interval: events.Interval, middle: float) -> dict[str, Any]:
    kind, label = interval.kind, interval.label
    title = f"{kind}: {label}" if kind != label else label
    return {
        **_bar(interval, middle, _LANE, label, f"<b>{title}</b>"),
        "insidetextanchor": "start",
        "insidetextfont": {"color": "ink", "size": 10},
        "constraintext": "none",
        "marker": {"color": events.TINTS.get(kind, "rgba(125,136,148,0.22)")},
    }


def _visit(visit: StateVisit, middle: float, colour: str, named: bool) -> dict[str, Any]:
    part = f" ({visit.part})" if visit.part and visit.part != visit.name else ""
    ended = f"<br>ended: {visit.ended}" if visit.ended else ""
    text, title = visit.name if named else "", f"<b>{visit.name}</b>{part}"
    return {
        **_bar(visit, middle, _BAR, text, title, ended),
        "insidetextanchor": "middle",
        "insidetextfont": {"color": "#10151b"},
        "marker": {"color": colour, "line": {"color": "paper", "width": 1}},
    }


def _phases(run: RecordedRun) -> dict[str, list[StateVisit]]:
    """Return the phases of each flow, by row name."""
    found: dict[str, list[StateVisit]] = {}
    for event in run.events:
        fields = event["fields"]
        if event["event"] == "phase_started":
            name, start = fields["phase"], event["t_s"]
            visit = StateVisit(name, "", start, run.end, "", aloft=False, built_in=False)
            found.setdefault(f"flow {fields['flow']}", []).append(visit)
        elif event["event"] == "phase_ended":
            visits = found[f"flow {fields['flow']}"]
            visits[-1] = replace(visits[-1], end=event["t_s"], ended=fields["how"])
    return found
