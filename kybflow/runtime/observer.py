"""What the runtime tells whoever records a vehicle. A recording implements it; the runtime knows
no other side of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from kybflow.core.signals import Command, Estimate, Measurement, Setpoint, Time, Truth


class EstimatorState(Protocol):
    """One estimator of a vehicle after a tick. is_usable: healthy, and its time is not used up."""

    @property
    def name(self) -> str: ...
    @property
    def estimate(self) -> Estimate | None: ...
    @property
    def is_usable(self) -> bool: ...


class EstimationState(Protocol):
    """The estimators of a vehicle after a tick. source: the name of the one that it flies on."""

    @property
    def source(self) -> str | None: ...
    @property
    def candidates(self) -> Sequence[EstimatorState]: ...


class VehicleObserver:
    """Hears what one vehicle measures, believes and sends. This base class ignores it all, which
    is enough for a preflight. No method may raise."""

    def measurement(self, now: Time, measurement: Measurement) -> None:
        """Called for each measurement that arrived in the tick at `now`."""

    def tick(
        self,
        now: Time,
        estimate: Estimate | None,
        wanted: Setpoint | None,
        setpoint: Setpoint | None,
        command: Command,
        truth: Truth | None,
    ) -> None:
        """Called once a tick: the estimate, the setpoint before and after the processors, the
        command that was sent, and the simulator's truth where there is one."""

    def estimators(self, now: Time, estimation: EstimationState) -> None:
        """Called once a tick with the state of every estimator."""
