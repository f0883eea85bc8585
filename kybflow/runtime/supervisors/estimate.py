"""Report a vehicle in the air that no longer knows where it is.

Alarm `estimate_lost` in the air when no estimator has an estimate, when the newest measurement in
it is older than `age`, or when its standard deviation is above `spread`. The alarm's value is the
age in seconds or the spread in metres. Without an estimate it is the time since the last estimate's
newest measurement, or since the first check, with a bound of zero.

The default reaction is `land_blind`, the only one that needs no position. An alarm that persists is
returned in every tick; the failsafe makes one event of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from kybflow.core.signals import NS, Alarm, Reaction, ReactionName, Tick, Time
from kybflow.core.units import DURATION, Duration, Length, format_quantity
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_MAX_BLIND_S = 5.0
"""Seconds after which the error of dead reckoning is several metres."""
_MIN_SPREAD = 1e-4
"""A spread (m) smaller than that of the best motion capture."""


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

    @classmethod
    def ends_outside(cls, params: EstimateSupervisorParams) -> Mapping[str, tuple[float, float]]:
        ends = Reaction[params.reaction.upper()] > Reaction.BRAKE
        bounds = {"estimate.age": (0.0, params.age), "estimate.spread": (0.0, params.spread)}
        return bounds if ends else {}

    @classmethod
    def objections(
        cls, params: EstimateSupervisorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        p, loop = params, context.loop
        late = context.dt if loop is None else max(context.dt, loop.pose_latency)
        if p.age <= late:
            age = format_quantity(late, DURATION)
            reason = f"alarms at once: the newest measurement is {age} old or older"
            yield Objection("age", reason, "write `age: 300 ms`", p.reaction == "warn")
        if p.age > _MAX_BLIND_S:
            reason = f"lets the vehicle fly blindly for {p.age:.3g} s"
            yield Objection("age", reason, "write `age: 300 ms`", is_doubt=True)
        if p.spread < _MIN_SPREAD:
            reason = "alarms at once: no estimate is as certain"
            yield Objection("spread", reason, "write `spread: 30 cm`", p.reaction == "warn")
        if context.fence is not None and p.spread > min(context.fence.size[:2]):
            reason = "never alarms: the fence is smaller"
            yield Objection("spread", reason, "write `spread: 30 cm`", is_doubt=True)

    def __init__(self, params: EstimateSupervisorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._newest: Time | None = None

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        estimate, p = tick.estimate, self.params
        if estimate is not None:
            self._newest = estimate.time - round(estimate.age * NS)
        elif self._newest is None:
            self._newest = tick.now
        if not off_ground:
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
