"""The figures of a run: errors, behaviors, estimators and battery of each vehicle.

For mean, rms and max only a count, a sum, a sum of squares and a peak are stored, so memory grows
with the number of behaviors entered and not with the number of ticks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from kybflow.dsl.plan import Plan


class Errors:
    """Accumulates samples of an error for its mean, rms and max."""

    __slots__ = ("count", "peak", "squares", "total")

    def __init__(self) -> None:
        self.count = 0
        self.total = self.squares = self.peak = 0.0

    def add(self, value: float) -> None:
        self.count += 1
        self.total += value
        self.squares += value * value
        if value > self.peak:  # noqa: PLR1730 (max() costs more, in every tick)
            self.peak = value

    def merge(self, other: Errors) -> None:
        """Add the samples of `other`."""
        self.count += other.count
        self.total += other.total
        self.squares += other.squares
        self.peak = max(self.peak, other.peak)

    def figures(self) -> dict[str, float] | None:
        """Return `mean`, `rms` and `max`, or None without a sample."""
        if not self.count:
            return None
        rms = math.sqrt(self.squares / self.count)
        return {
            "mean": rounded(self.total / self.count),
            "rms": rounded(rms),
            "max": rounded(self.peak),
        }


class BehaviorScore(NamedTuple):
    """One visit to a state, with its errors from `start_s` to `end_s` (s). ended: how the behavior
    ended. `end_s` and `ended` are None while the visit lasts."""

    name: str
    part: str
    start_s: float
    position: Errors
    velocity: Errors
    end_s: float | None = None
    ended: str | None = None

    def record(self) -> dict[str, Any]:
        """Return the visit's entry in `summary.json`."""
        return {
            "name": self.name,
            "part": self.part,
            "start_s": rounded(self.start_s),
            "end_s": None if self.end_s is None else rounded(self.end_s),
            "ended": self.ended,
            "position_error_m": self.position.figures(),
            "velocity_error_m_s": self.velocity.figures(),
        }


class EstimatorInterval(NamedTuple):
    """The time (s) from which an estimator was in use. The name is empty if no estimator was
    healthy."""

    name: str
    start_s: float


class VehicleScore:
    """Collects the figures of one vehicle during the run.

    position, velocity: the errors of the current visit (m, m/s). A tick adds to each only if its
    setpoint has that field.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.behaviors: list[BehaviorScore] = []
        self.estimators: list[EstimatorInterval] = []
        self.min_battery: float | None = None
        self.min_clearance: float | None = None
        self.failures: list[str] = []
        self.flights: list[tuple[float, float | None]] = []
        self.foreign_commands: list[str] = []
        self.position, self.velocity = Errors(), Errors()

    def entered(self, state: str, part: str, t_s: float) -> None:
        """Begin a visit to a state, which may be the current state again."""
        self.position, self.velocity = Errors(), Errors()
        self.behaviors.append(BehaviorScore(state, part, t_s, self.position, self.velocity))

    def left(self, how: str, t_s: float) -> None:
        """End the current visit. how: how its behavior ended."""
        if self.behaviors:
            self.behaviors[-1] = self.behaviors[-1]._replace(end_s=t_s, ended=how)

    def failure(self, reason: str) -> None:
        """Record a failure of the current behavior that the mission does not handle."""
        self.failures.append(f"`{self.behaviors[-1].name}` failed: {reason}")

    def in_air(self, is_in_air: bool, t_s: float) -> None:
        """Begin or end an interval in which the ground doesn't carry the vehicle. Errors are
        measured only then."""
        self.flights.append((t_s, None) if is_in_air else (self.flights.pop()[0], t_s))

    def foreign(self, reason: str, allowed: bool) -> None:
        """Record that another program commanded the vehicle; unless `allowed`, this is a
        failure."""
        if not allowed and not self.foreign_commands:
            self.failures.append(f"another program commanded it: {reason}")
        self.foreign_commands.append(reason)

    def estimator(self, name: str, t_s: float) -> None:
        """Record that this estimator is in use from `t_s` on."""
        self.estimators.append(EstimatorInterval(name, t_s))

    def battery(self, remaining: float) -> None:
        """Add a report of the battery's remaining charge, 0 to 1."""
        if self.min_battery is None or remaining < self.min_battery:
            self.min_battery = remaining

    def clearance(self, metres: float) -> None:
        """Add the distance of the rotor tips from the nearest obstacle."""
        if self.min_clearance is None or metres < self.min_clearance:
            self.min_clearance = metres

    def record(self) -> dict[str, Any]:
        """Return the vehicle's figures in `summary.json`."""
        return {
            "airborne_s": [
                [rounded(start), None if end is None else rounded(end)]
                for start, end in self.flights
            ],
            "position_error_m": _merged([v.position for v in self.behaviors]).figures(),
            "velocity_error_m_s": _merged([v.velocity for v in self.behaviors]).figures(),
            "behaviors": [visit.record() for visit in self.behaviors],
            "estimators": [
                {"name": use.name, "start_s": rounded(use.start_s)} for use in self.estimators
            ],
            "min_battery": None if self.min_battery is None else rounded(self.min_battery),
            "min_clearance_m": None if self.min_clearance is None else rounded(self.min_clearance),
            "foreign_commands": self.foreign_commands,
        }


class Score:
    """The figures of every vehicle of a plan."""

    def __init__(self, plan: Plan) -> None:
        self.vehicles = {vehicle.name: VehicleScore(vehicle.name) for vehicle in plan.vehicles}

    def vehicle(self, name: str) -> VehicleScore:
        return self.vehicles[name]


def rounded(value: float) -> float:
    """Return `value` with six significant digits, as in the summary."""
    return float(f"{value:.6g}")


def _merged(parts: Sequence[Errors]) -> Errors:
    whole = Errors()
    for part in parts:
        whole.merge(part)
    return whole
