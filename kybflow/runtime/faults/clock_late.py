"""The program's tick comes late for the vehicle: every command takes effect later.

As when the computer is too busy or the radio too slow: what a tick decides on its measurements
reaches the vehicle `by` later. While the first one is awaited none arrives, so that one later than
the vehicle's watchdog waits brings it down. When the fault ends, what is still on its way is lost.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Duration
from kybflow.parts import Effect, Fault, param, params


@params
class ClockLateParams:
    by: Duration = param(
        "How late each command takes effect.", default=0.02, above=0.0, at_most=10.0,
        read_only=True,
    )  # fmt: skip


class ClockLate(Fault[ClockLateParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(late=self.params.by)}
