"""The current situation of a run and the commands that it would accept now, as plain values.

The fields `enter`, `pause`, `resume`, `reset` and `land` hold the reason for which the command
would be refused now, as the refusal would state it, or None if the command is legal. A behavior may
still refuse to start when it is entered. Positions (m) and velocities (m/s) are in the world frame;
times are seconds since the start of the run.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from kybflow.core.geometry import Vec3


@dataclass(frozen=True, slots=True)
class EstimateSummary:
    """The estimate that a vehicle flies on. heading: in rad, from east. age: in seconds. estimator:
    the estimator's name in the mission."""

    position: Vec3
    velocity: Vec3
    heading: float
    age: float
    estimator: str | None


@dataclass(frozen=True, slots=True)
class SetpointSummary:
    """The setpoint that a vehicle's tracker follows. A field that the setpoint lacks is None."""

    position: Vec3 | None
    velocity: Vec3 | None


@dataclass(frozen=True, slots=True)
class VehicleSituation:
    """One vehicle.

    state: the active state, empty before the first.
    behavior: the part that flies the vehicle in that state.
    flight: `ground`, `air`, or `moving` while it takes off or lands.
    elapsed: seconds since the state was entered.
    holders: what holds the vehicle: `pause`, `brake`, `pilot`.
    latched: the failsafe's latched reaction, which only a reset clears.
    braking: the reasons of the alarms that brake the vehicle.
    override: why a pilot or another program has control.
    retired: why the vehicle lands for the rest of the run.
    driver: the flow that drives the vehicle.
    battery: the remaining charge, 0 to 1.
    waits_for: the events that a transition of the state waits for.
    enter: for each state that can be requested, why it would be refused.
    """

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
    """One flow.

    phase: the current phase, None while the flow is inactive.
    elapsed: seconds since the phase was entered.
    vehicles: the vehicles that the flow drives.
    waits_for: the events that a transition of the phase waits for.
    enter: for each phase, why a request for it would be refused.
    """

    name: str
    phase: str | None
    elapsed: float
    vehicles: tuple[str, ...]
    waits_for: tuple[str, ...]
    enter: dict[str, str | None]


@dataclass(frozen=True, slots=True)
class Situation:
    """The whole run. flying: whether the preflight is over. holder: the name of the lease's holder.
    emit: for each event that a person can emit, whether something waits for it now."""

    mission: str
    time: float
    flying: bool
    holder: str | None
    vehicles: tuple[VehicleSituation, ...]
    flows: tuple[FlowSituation, ...]
    emit: dict[str, bool]

    def record(self) -> dict[str, Any]:
        """Return the situation as values that can be encoded as JSON."""
        return asdict(self)
