"""Which events are alarms or routine, their fields as text, and their marks in the timeline."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from kybflow.report.data import Run

BARS = frozenset({"behavior_started", "behavior_ended", "phase_started", "phase_ended"})
"""Events that are shown as bars."""
IMPACTS = frozenset({"collided", "landed_hard"})
"""Events of a vehicle that hit something, as the simulator knows."""
COLLISION, ALARM, EVENT = "collision", "alarm", "event"
_ALARMING = (
    "failed", "lost", "breached", "exceeded", "refused", "low", "failsafe_started", "clamp_started",
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
    """How an event is marked. One with a reaction and a bound is an alarm of a supervisor."""
    name = event["event"]
    if name in IMPACTS:
        return COLLISION
    is_alarm = {"reaction", "bound"} <= event["fields"].keys()
    return ALARM if is_alarm or name.endswith(_ALARMING) else EVENT


def is_notable(event: Mapping[str, Any]) -> bool:
    """Whether it is out of the ordinary: no step of a flight in which all goes well."""
    if event["event"] == "estimator_changed":
        return event["fields"].get("previous") is not None
    return event["event"] not in _ROUTINE and not event["event"].endswith(".finished")


def impact_text(event: Mapping[str, Any]) -> str:
    """What a vehicle hit, as text."""
    fields = event["fields"]
    if event["event"] == "collided":
        return f"ran into {fields.get('into')}"
    return f"landed hard ({fields['speed']:.2f} m/s) on {fields['onto']}"


def fields_text(event: Mapping[str, Any]) -> str:
    """The fields of an event that have a value, as text."""
    return ", ".join(
        f"{name}: {_value(value)}" for name, value in event["fields"].items() if value is not None
    )


def marks(run: Run, rows: Mapping[str, float]) -> list[dict[str, Any]]:
    """A trace for each kind of mark; `rows` says how far down each vehicle's and the run's marks
    are. The events of one vehicle at one time share a mark."""
    found: dict[str, dict[tuple[float, float], list[str]]] = {kind: {} for kind in _LOOKS}
    for event in run.events:
        row = event["vehicle"] or "run"
        if event["event"] not in BARS and row in rows:
            place = (event["t_s"], rows[row])
            found[kind_of(event)].setdefault(place, []).append(_hover_text(event))
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


def _hover_text(event: Mapping[str, Any]) -> str:
    said = fields_text(event)
    place = f" ({escape(event['at'])})" if event["at"] else ""
    return f"{event['event']}{' - ' if said else ''}{escape(said)}{place}"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def ending(run: Run, name: str) -> str:
    """Where a vehicle was at the end, the fault that it was in, and what it ran into; as text."""
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
    """The reason of the last failsafe that ended the flight, else of the last failure."""
    stopped = [
        event["fields"]["reason"]
        for event in events
        if event["event"] == "failsafe_started" and event["fields"].get("reaction") != "brake"
    ]
    failed = [event["fields"]["reason"] for event in events if event["event"].endswith("_failed")]
    return str((stopped or failed or [""])[-1])
