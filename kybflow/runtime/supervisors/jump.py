"""Report a position that jumps from one measurement to the next.

It is checked 50 times a second: when the estimate contains a newer measurement (its `time` minus
its `age` has increased), its position is compared with the extrapolation of the last estimate, r =
|p - (p' + v' dt)|, whose velocity was measured t ago. Alarm `jumped` in the air when r is more than
`factor` times its running average over about 20 checks, and more than `at_least` + a t^2 / 2, the
second part of which a change of motion can explain (a = 5 m/s^2, as in `kybflow.flight.pose_gate`).
This is the flying courier's check of position differences, made independent of the vehicle's own
motion, so that a gap in the measurements is not a jump. The alarm lasts 1 s. After a change of the
estimator the check restarts. World frame, metres.

The default reaction is `land_blind`, because it is unknown which of the two positions is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Alarm, Estimate, Reaction, ReactionName, Tick, Time
from kybflow.core.units import Length, Number
from kybflow.flight.pose_gate import ACCELERATION
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_AVERAGING_SHARE = 0.05
_NOISE, _MAX_FACTOR = 0.002, 100.0
"""The noise of motion capture (m), and a multiple of the average step that hardly any jump
reaches."""
_ALARM_TIME_NS = NS
_SAME_TIME_NS = NS // 1000


@params
class JumpParams:
    factor: Number = param(
        "Largest multiple of the average step.", default=4.0, above=1.0, tightens="down"
    )
    at_least: Length = param(
        "Step below which a jump is ignored.", default=0.1, above=0.0, tightens="down"
    )
    reaction: ReactionName = param("What the failsafe does.", default="land_blind", tightens="up")


class Jump(Supervisor[JumpParams]):
    always = True
    unhurried = True
    events = ("jumped",)

    @classmethod
    def objections(cls, params: JumpParams, context: VehicleContext) -> Iterator[Objection]:
        p = params
        if p.at_least < _NOISE:
            reason = "mistakes the noise of motion capture for a jump"
            yield Objection("at_least", reason, "write `at_least: 10 cm`", is_doubt=True)
        if context.fence is not None and p.at_least > min(context.fence.size[:2]):
            reason = "never alarms: the fence is smaller"
            yield Objection("at_least", reason, "write `at_least: 10 cm`", is_doubt=True)
        if p.factor > _MAX_FACTOR:
            reason = f"alarms at {p.factor:g} times the average step"
            yield Objection("factor", reason, "write `factor: 4`", is_doubt=True)

    def __init__(self, params: JumpParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._last: Estimate | None = None
        self._measured: Time = 0
        self._average = 0.0
        self._alarm: Alarm | None = None
        self._until: Time = 0

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        estimate = tick.estimate
        if estimate is None:
            self._last = None
        else:
            measured = estimate.time - round(estimate.age * NS)
            if self._last is None or measured - self._measured > _SAME_TIME_NS:
                self._measured = measured
                alarm = self._judged(estimate)
                if alarm is not None and off_ground:
                    self._alarm, self._until = alarm, tick.now + _ALARM_TIME_NS
        alarm = self._alarm
        return alarm if alarm is not None and off_ground and tick.now < self._until else None

    def _judged(self, estimate: Estimate) -> Alarm | None:
        last, self._last = self._last, estimate
        if last is None or last.source != estimate.source:
            return None
        t = (estimate.time - last.time) / NS
        unknown = t + last.age
        x, y, z = last.position
        vx, vy, vz = last.velocity
        step = distance(estimate.position, (x + t * vx, y + t * vy, z + t * vz))
        p, average = self.params, self._average
        self._average += _AVERAGING_SHARE * (step - average)
        bound = max(p.factor * average, p.at_least + 0.5 * ACCELERATION * unknown * unknown)
        if step <= bound:
            return None
        reason = f"its position jumped by {step:.2f} m, {bound:.2f} m allowed"
        return Alarm("jumped", Reaction[p.reaction.upper()], reason, step, bound)
