"""Nothing arms before this is green: a healthy estimate that agrees with the declared start."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.geometry import distance
from kybflow.runtime.vehicle import Vehicle

START_TOLERANCE = 0.25
"""Metres between the estimate and the declared start; two swapped mocap bodies are further
apart."""


class Line(NamedTuple):
    """One line of the preflight: of which vehicle, what was looked at, whether it is well, and
    why."""

    vehicle: str
    check: str
    green: bool
    reason: str


def preflight(vehicle: Vehicle) -> tuple[Line, ...]:
    """The lines of one vehicle, as it stands on the ground. What a supervisor would land it for in
    the air keeps it there."""
    estimate, battery, name = vehicle.estimate, vehicle.battery, vehicle.name
    if vehicle.link_error is not None:
        return (Line(name, "link", False, vehicle.link_error),)
    if estimate is None:
        sources = ", ".join(e.part.name for e in vehicle.plan.estimators)
        return (Line(name, "estimate", False, f"no healthy estimate from {sources}"),)
    away = distance(estimate.position, vehicle.site.start)
    foreseen = (Line(name, label, False, reason) for label, reason in vehicle.foreseen())
    return (
        Line(name, "estimate", True, f"{estimate.source}, spread {estimate.spread * 1000:.1f} mm"),
        Line(
            name,
            "start pose",
            away <= START_TOLERANCE,
            f"{away:.2f} m from the declared start ({START_TOLERANCE:.2f} m allowed)",
        ),
        Line(
            name,
            "battery",
            battery is not None,
            "no report" if battery is None else f"{battery.remaining:.0%}",
        ),
        *foreseen,
    )
