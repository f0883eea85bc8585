"""Every command takes effect later.

This simulates a busy computer or a slow radio: the command of a tick reaches the vehicle `by`
later. No command arrives before the first delayed one, so a delay longer than the vehicle's
watchdog makes the vehicle land. Commands that are on their way when the fault ends are lost.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Duration
from kybflow.parts import Effect, Fault, param, params


@params
class ClockLateParams:
    by: Duration = param(
        "Delay of each command.", default=0.02, above=0.0, at_most=10.0,
        read_only=True,
    )  # fmt: skip


class ClockLate(Fault[ClockLateParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(late=self.params.by)}
