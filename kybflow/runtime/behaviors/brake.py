"""Brake in the direction of flight until the vehicle is at rest.

The setpoint runs along the stopping path v(t) = v0 (1 - S(t / T)), S the quintic smoothstep and
T = 15/8 |v0| / deceleration (at least 0.5 s), which is v0 T / 2 long. v0 is the velocity of the
last setpoint, or of the estimate if the vehicle was not following one. The behavior is done when
the path has ended and the estimate is slower than `slower_than` (0.1 m/s, as in TeleKyb's
NormalBrake), but at the latest `patience` after the end of the path: the hover that follows holds
the same point.
"""

from __future__ import annotations

from kybflow.core.geometry import norm
from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Speed
from kybflow.flight.motion import Coast
from kybflow.parts import AIR, MOVING, Behavior, Entry, param, params


@params
class BrakeParams:
    deceleration: Acceleration = param(
        "Largest deceleration along the stopping path.", default=2.0, above=0.0, read_only=True
    )
    slower_than: Speed = param("Speed below which the vehicle has stopped.", default=0.1, above=0.0)
    patience: Duration = param(
        "Time after the planned end of the path at which the behavior is done in any case.",
        default=5.0,
        at_least=0.0,
    )


class Brake(Behavior[BrakeParams], flight=(AIR >> AIR, MOVING >> AIR), emits=SetpointKind.POSITION):
    def __init__(self, params: BrakeParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._heading = entry.heading
        self._coast = Coast.after(entry.motion, params.deceleration)

    def update(self, tick: Tick) -> Setpoint | Done:
        setpoint = self._coast.at(tick.elapsed).setpoint(self._heading)
        over = tick.elapsed - self._coast.duration
        if over < 0.0:
            return setpoint
        stopped = norm(tick.known().velocity) < self.params.slower_than
        return Done(setpoint) if stopped or over >= self.params.patience else setpoint
