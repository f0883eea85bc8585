"""The interface between the runtime and a recording, which implements `VehicleObserver`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from kybflow.core.signals import Command, Estimate, Measurement, Setpoint, Time, Truth


class EstimatorState(Protocol):
    """One estimator after a tick. is_usable: whether it is healthy and within its time limit."""

    @property
    def name(self) -> str: ...
    @property
    def estimate(self) -> Estimate | None: ...
    @property
    def is_usable(self) -> bool: ...


class EstimationState(Protocol):
    """A vehicle's estimators after a tick. source: the name of the estimator in use."""

    @property
    def source(self) -> str | None: ...
    @property
    def candidates(self) -> Sequence[EstimatorState]: ...


class VehicleObserver:
    """Receives the measurements, estimates and commands of one vehicle. This base class discards
    them, which suffices for a preflight. Methods must not raise."""

    def measurement(self, now: Time, measurement: Measurement) -> None:
        """Record a measurement that arrived in the tick at `now`."""

    def tick(
        self,
        now: Time,
        estimate: Estimate | None,
        wanted: Setpoint | None,
        setpoint: Setpoint | None,
        command: Command,
        truth: Truth | None,
        estimation: EstimationState,
    ) -> None:
        """Record a tick: the estimate, the setpoint before the processors (`wanted`) and after
        them (`setpoint`), the command that was sent, the simulator's ground truth (None on
        hardware), and the state of every estimator."""
