"""What the report and viewers share in showing a run: the vehicles' colours, and how grave an event
is and how it reads. An event is here as `kybflow.recording.layout.event_record` writes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

VEHICLE_COLOURS = (
    "#2f7ed8", "#e07b26", "#1f9e77", "#a55ec4", "#d1495b", "#7a8b1f", "#00a3b5", "#c2578f",
)  # fmt: skip


def vehicle_colour(number: int) -> str:
    """Return the colour of the vehicle with this number, or of a run among others."""
    return VEHICLE_COLOURS[number % len(VEHICLE_COLOURS)]


IMPACTS = frozenset({"collided", "landed_hard"})
"""Events by which a simulator reports that a vehicle hit something."""
COLLISION, ALARM, EVENT = "collision", "alarm", "event"
_ALARMING = (
    "failed", "lost", "breached", "exceeded", "refused", "low", "failsafe_started", "clamp_started",
    "fault_injected", "run_stopped",
)  # fmt: skip


def kind_of(event: Mapping[str, Any]) -> str:
    """Return how grave an event is: `COLLISION`, `ALARM` or `EVENT`. An event with a reaction and a
    bound is a supervisor's alarm."""
    name = event["event"]
    if name in IMPACTS:
        return COLLISION
    is_alarm = {"reaction", "bound"} <= event["fields"].keys()
    return ALARM if is_alarm or name.endswith(_ALARMING) else EVENT


def fields_text(event: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name}: {_value(value)}"
        for name, value in event["fields"].items()
        if value is not None and name != "traceback"
    )


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
