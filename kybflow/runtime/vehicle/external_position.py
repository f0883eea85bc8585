"""Selects the estimate that is sent to a vehicle as its external position (an autopilot's external
vision).

This is the estimate in use, unless it comes from the vehicle itself or from dead reckoning that
continues the vehicle's own: then it is that of the first usable external estimator. The autopilot
would take its own estimate for an independent one, and a lost position would go unnoticed.
"""

from __future__ import annotations

from kybflow.core.signals import Estimate, Imu
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.vehicle.estimation import Estimation

_INERTIAL = frozenset({Imu})
"""The measurements of dead reckoning."""


class ExternalPosition:
    """Selects the external position of one vehicle."""

    def __init__(self, plan: VehiclePlan, estimation: Estimation) -> None:
        self._estimation = estimation
        self._own, self._inertial = set[str](), set[str]()
        self._is_echo = False
        for part in (estimator.part for estimator in plan.estimators):
            name = part.label.rpartition(".")[2]
            if part.cls.own:
                self._own.add(name)
            elif part.cls.uses(part.params) <= _INERTIAL:
                self._inertial.add(name)

    def of(self, flown: Estimate | None) -> Estimate | None:
        """Return the estimate to send in this tick, None for nothing. flown: the one in use."""
        source = self._estimation.source
        if source is None:
            return None
        if source in self._own:
            self._is_echo = True
        elif source not in self._inertial:
            self._is_echo = False
        return self._other() if self._is_echo else flown

    def _other(self) -> Estimate | None:
        inside = self._own | self._inertial
        for candidate in self._estimation.candidates:
            if candidate.name not in inside and candidate.is_usable:
                return candidate.estimate
        return None
