"""How each vehicle ended, in words."""

from __future__ import annotations

from typing import Any

from kybflow.report.data import Run


def ended(run: Run, name: str, vehicle: dict[str, Any]) -> str:
    """Where a vehicle was at the end, the fault that it was in, and what it ran into; as text."""
    place = "on the ground" if vehicle["final"] == "ground" else "in the air"
    visits = vehicle["behaviors"]
    last = visits[-1] if visits else None
    own = [event for event in run.events if event["vehicle"] == name]
    parts = [place]
    if last is not None and last["name"] == "fault":
        reason = _why([event for event in own if event["t_s"] <= last["start_s"]])
        parts.append(f"in fault: {reason}" if reason else "in fault")
    parts += [
        f"ran into {event['fields'].get('into')} at {event['t_s']:.2f} s"
        for event in own
        if event["event"] == "collided"
    ]
    return ", ".join(parts)


def _why(events: list[dict[str, Any]]) -> str:
    """The reason of the last failsafe that ended the flight, else of the last failure."""
    told = [
        event["fields"]["reason"]
        for event in events
        if event["event"] == "failsafe_started" and event["fields"].get("reaction") != "brake"
    ]
    failed = [event["fields"]["reason"] for event in events if event["event"].endswith("_failed")]
    return str((told or failed or [""])[-1])
