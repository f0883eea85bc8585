"""Report an airborne vehicle that no longer knows where it is.

Alarm `estimate_lost` in the air when no estimator has an estimate, when the newest measurement in
it is older than `age`, or when its standard deviation is above `spread`. Its value is the age in
seconds (where there is no estimate: since the last one's newest measurement, or since the check
began, none allowed) or the spread in metres.

The default reaction is `land_blind`, the only one that needs no position. An alarm that persists is
returned in every tick; the engine makes one event of it.
"""

from __future__ import annotations

from kybflow.core.signals import NS, Alarm, Reaction, ReactionName, Tick, Time
from kybflow.core.units import Duration, Length
from kybflow.parts import Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext


@params
class EstimateSupervisorParams:
    age: Duration = param(
        "Largest age of the newest measurement.", default=0.3, above=0.0, tightens="down"
    )
    spread: Length = param(
        "Largest standard deviation of the position.", default=0.3, above=0.0, tightens="down"
    )
    reaction: ReactionName = param("What the failsafe does.", default="land_blind", tightens="up")


class EstimateSupervisor(Supervisor[EstimateSupervisorParams]):
    always = True
    unhurried = True
    events = ("estimate_lost",)

    def __init__(self, params: EstimateSupervisorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._newest: Time | None = None

    def check(self, tick: Tick, airborne: bool) -> Alarm | None:
        estimate, p = tick.estimate, self.params
        if estimate is not None:
            self._newest = estimate.time - round(estimate.age * NS)
        elif self._newest is None:
            self._newest = tick.now
        if not airborne:
            return None
        if estimate is None:
            silence = (tick.now - self._newest) / NS
            return self._alarm("no estimator has an estimate", silence, 0.0)
        if estimate.age > p.age:
            reason = f"its newest measurement is {estimate.age:.2f} s old, {p.age:g} s allowed"
            return self._alarm(reason, estimate.age, p.age)
        if estimate.spread > p.spread:
            reason = f"its spread is {estimate.spread:.2f} m, {p.spread:g} m allowed"
            return self._alarm(reason, estimate.spread, p.spread)
        return None

    def _alarm(self, reason: str, value: float, bound: float) -> Alarm:
        reaction = Reaction[self.params.reaction.upper()]
        return Alarm("estimate_lost", reaction, reason, value, bound)
