"""Which estimate a vehicle is told as its position from outside (an autopilot's external vision).

What is flown on, unless that is the vehicle's own: then the first of the list that can be used and
is from outside. Dead reckoning that went on from the vehicle's own estimate is its own too. Told
back to it, either would be taken for truth, and nobody would notice that the position is lost.
"""

from __future__ import annotations

from kybflow.core.signals import Estimate, Imu
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.vehicle.estimation import Estimation

_FELT = frozenset({Imu})
"""What an estimator needs that sees nothing."""


class ExternalPosition:
    """Chooses the estimate that one vehicle is told."""

    def __init__(self, plan: VehiclePlan, estimation: Estimation) -> None:
        self._estimation = estimation
        self._own, self._felt = set[str](), set[str]()
        self._is_echo = False
        for part in (estimator.part for estimator in plan.estimators):
            name = part.label.rpartition(".")[2]
            if part.cls.own:
                self._own.add(name)
            elif part.cls.uses(part.params) <= _FELT:
                self._felt.add(name)

    def of(self, flown: Estimate | None) -> Estimate | None:
        """What to tell in this tick, None for nothing. flown: what it flies on."""
        source = self._estimation.source
        if source is None:
            return None
        if source in self._own:
            self._is_echo = True
        elif source not in self._felt:
            self._is_echo = False
        return self._other() if self._is_echo else flown

    def _other(self) -> Estimate | None:
        inside = self._own | self._felt
        for candidate in self._estimation.candidates:
            if candidate.name not in inside and candidate.is_usable:
                return candidate.estimate
        return None
