"""Classifies events as alarms or routine, formats their fields, and marks them in the timeline."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from kybflow.report.data import Run
from kybflow.report.plot import markers

BARS = frozenset({"behavior_started", "behavior_ended", "phase_started", "phase_ended"})
"""Events that the timeline shows as bars."""
IMPACTS = frozenset({"collided", "landed_hard"})
"""Events by which a simulator reports that a vehicle hit something."""
COLLISION, ALARM, EVENT = "collision", "alarm", "event"
_ALARMING = (
    "failed", "lost", "breached", "exceeded", "refused", "low", "failsafe_started", "clamp_started",
    "fault_injected", "run_stopped",
)  # fmt: skip
_ROUTINE = BARS | {
    "run_started", "run_ended", "preflight_passed", "took_off", "landed", "driver_changed",
    "payload_loaded", "payload_released", "payload_rested",
}  # fmt: skip
_MARKERS = {
    EVENT: {"symbol": "triangle-up", "color": "ink", "size": 9},
    ALARM: {"symbol": "diamond", "color": "alarm", "size": 9},
    COLLISION: {"symbol": "x", "color": "alarm", "size": 13},
}


def kind_of(event: Mapping[str, Any]) -> str:
    """Return the kind of mark for an event. An event with a reaction and a bound is a supervisor's
    alarm."""
    name = event["event"]
    if name in IMPACTS:
        return COLLISION
    is_alarm = {"reaction", "bound"} <= event["fields"].keys()
    return ALARM if is_alarm or name.endswith(_ALARMING) else EVENT


def is_notable(event: Mapping[str, Any]) -> bool:
    """Return whether an event is more than a normal step of a flight."""
    if event["event"] == "estimator_changed":
        return event["fields"].get("previous") is not None
    return event["event"] not in _ROUTINE and not event["event"].endswith(".finished")


def impact_text(event: Mapping[str, Any]) -> str:
    fields = event["fields"]
    if event["event"] == "collided":
        return f"ran into {fields.get('into')}"
    return f"landed hard ({fields['speed']:.2f} m/s) on {fields['onto']}"


def fields_text(event: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name}: {_value(value)}" for name, value in event["fields"].items() if value is not None
    )


def marks(run: Run, rows: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return a trace for each kind of mark. Events of one vehicle at the same time share a mark.
    rows: the y coordinates of the marks, by vehicle and for the `run`."""
    found: dict[str, dict[tuple[float, float], list[str]]] = {kind: {} for kind in _MARKERS}
    for event in run.events:
        row = event["vehicle"] or "run"
        if event["event"] not in BARS and row in rows:
            place = (event["t_s"], rows[row])
            fields, at = fields_text(event), f" ({escape(event['at'])})" if event["at"] else ""
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


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def ending(run: Run, name: str) -> str:
    """Describe how a vehicle's run ended: in the air or on the ground, any fault, and what it
    hit."""
    vehicle = run.summary["vehicles"][name]
    visits = vehicle["behaviors"]
    last = visits[-1] if visits else None
    own = [event for event in run.events if event["vehicle"] == name]
    parts = ["on the ground" if vehicle["final"] == "ground" else "in the air"]
    if last is not None and last["name"] == "fault":
        reason = _fault_reason([event for event in own if event["t_s"] <= last["start_s"]])
        parts.append(f"in fault: {reason}" if reason else "in fault")
    parts += [
        f"{impact_text(event)} at {event['t_s']:.2f} s"
        for event in own
        if event["event"] in IMPACTS
    ]
    return ", ".join(parts)


def _fault_reason(events: list[dict[str, Any]]) -> str:
    """Return the reason of the last failsafe that ended the flight, or else of the last failure."""
    stopped = [
        event["fields"]["reason"]
        for event in events
        if event["event"] == "failsafe_started" and event["fields"].get("reaction") != "brake"
    ]
    failed = [event["fields"]["reason"] for event in events if event["event"].endswith("_failed")]
    return str((stopped or failed or [""])[-1])
