"""What a run does now and what a person may ask of it now, as plain values.

In each of these, a reason is why a command would be refused now, in the refusal's own words, and
None stands for a command that is legal. A behavior may still refuse to start when it is entered.
Positions in the world, m and m/s; seconds of the run.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from kybflow.core.geometry import Vec3


@dataclass(frozen=True, slots=True)
class EstimateSummary:
    """The estimate that a vehicle flies on, and the mission's name of its estimator. heading: rad
    from east."""

    position: Vec3
    velocity: Vec3
    heading: float
    age: float
    estimator: str | None


@dataclass(frozen=True, slots=True)
class SetpointSummary:
    """The setpoint that a vehicle's tracker follows; None for fields that it doesn't have."""

    position: Vec3 | None
    velocity: Vec3 | None


@dataclass(frozen=True, slots=True)
class VehicleSituation:
    """One vehicle. state: empty before the first; behavior: the part that flies it. flight:
    `ground`, `air` or `moving` (it takes off or lands). elapsed: in the state. holders: who holds
    it: `pause`, `brake`, `pilot`. latched: the failsafe's reaction that only a reset undoes.
    braking: the alarms that brake it. override: why somebody else has control. retired: why it
    lands for the rest of the run. driver: the flow that drives it. enter: each state that can be
    requested. waits_for: the events that a transition of its state waits for."""

    name: str
    state: str
    behavior: str
    flight: str
    elapsed: float
    holders: tuple[str, ...]
    latched: str | None
    braking: str | None
    override: str | None
    retired: str | None
    driver: str | None
    battery: float | None
    estimate: EstimateSummary | None
    setpoint: SetpointSummary | None
    waits_for: tuple[str, ...]
    enter: dict[str, str | None]
    pause: str | None
    resume: str | None
    reset: str | None
    land: str | None


@dataclass(frozen=True, slots=True)
class FlowSituation:
    """One flow. phase: None while it is in none. enter: each phase. waits_for: the events that a
    transition of its phase waits for."""

    name: str
    phase: str | None
    elapsed: float
    vehicles: tuple[str, ...]
    waits_for: tuple[str, ...]
    enter: dict[str, str | None]


@dataclass(frozen=True, slots=True)
class Situation:
    """The whole run. flying: the preflight is over. holder: who has the lease. emit: the events
    that a person can give, each with whether something waits for it now."""

    mission: str
    time: float
    flying: bool
    holder: str | None
    vehicles: tuple[VehicleSituation, ...]
    flows: tuple[FlowSituation, ...]
    emit: dict[str, bool]

    def record(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return asdict(self)
