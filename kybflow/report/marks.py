"""Which events matter how much, what they say, and their marks in the timeline."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from kybflow.report.data import Run

BARS = frozenset({"behavior_started", "behavior_ended", "phase_started", "phase_ended"})
"""Events that are shown as bars."""
COLLISION, ALARM, EVENT = "collision", "alarm", "event"
_ALARMING = (
    "failed", "lost", "breached", "exceeded", "refused", "low", "failsafe_started",
    "fault_injected", "run_stopped",
)  # fmt: skip
_ROUTINE = BARS | {
    "run_started", "run_ended", "preflight_passed", "took_off", "landed", "driver_changed",
    "payload_loaded", "payload_released", "payload_rested",
}  # fmt: skip
_LOOKS = {
    EVENT: ("triangle-up", "ink", 9),
    ALARM: ("diamond", "alarm", 9),
    COLLISION: ("x", "alarm", 13),
}


def kind_of(event: Mapping[str, Any]) -> str:
    """How an event is marked. One that tells a reaction and a bound is an alarm of a part."""
    name = event["event"]
    if name == "collided":
        return COLLISION
    is_alarm = {"reaction", "bound"} <= event["fields"].keys()
    return ALARM if is_alarm or name.endswith(_ALARMING) else EVENT


def is_notable(event: Mapping[str, Any]) -> bool:
    """Whether it is out of the ordinary: no step of a flight in which all goes well."""
    if event["event"] == "estimator_changed":
        return event["fields"].get("previous") is not None
    return event["event"] not in _ROUTINE and not event["event"].endswith(".finished")


def told(event: Mapping[str, Any]) -> str:
    """What an event says besides its name, as text."""
    return ", ".join(
        f"{name}: {_value(value)}" for name, value in event["fields"].items() if value is not None
    )


def marks(run: Run, rows: Mapping[str, float]) -> list[dict[str, Any]]:
    """A trace for each kind of mark; `rows` says how far down. What was told of one vehicle at one
    time shares a mark."""
    found: dict[str, dict[tuple[float, float], list[str]]] = {kind: {} for kind in _LOOKS}
    for event in run.events:
        row = event["vehicle"] or "run"
        if event["event"] not in BARS and row in rows:
            place = (event["t_s"], rows[row])
            found[kind_of(event)].setdefault(place, []).append(_hovered(event))
    return [_trace(kind, places) for kind, places in found.items() if places]


def _trace(kind: str, places: Mapping[tuple[float, float], list[str]]) -> dict[str, Any]:
    symbol, colour, size = _LOOKS[kind]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": kind,
        "x": [time for time, _ in places],
        "y": [row for _, row in places],
        "text": ["<br>".join(texts) for texts in places.values()],
        "hovertemplate": "<b>%{x:.2f} s</b><br>%{text}<extra></extra>",
        "marker": {"symbol": symbol, "color": colour, "size": size},
    }


def _hovered(event: Mapping[str, Any]) -> str:
    said = told(event)
    place = f" ({escape(event['at'])})" if event["at"] else ""
    return f"{event['event']}{' - ' if said else ''}{escape(said)}{place}"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
