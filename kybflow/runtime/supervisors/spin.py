"""Report a vehicle that turns about its vertical axis faster than commanded.

It raises the alarm `spinning` if, in the air, the turn rate about body z minus the setpoint's
heading rate, averaged over the last quarter of a second, exceeds `limit`. The alarm then lasts for
as long as the vehicle flies. Rotors that can keep a vehicle up and level may not be able to hold
its heading: with a weak rotor it spins faster and faster, until its attitude can't be held either.
Without an estimate nothing is reported, and a rate does not count while the estimate's newest
measurement is older than 0.1 s. Rates are in radians per second.

The default reaction is `land`: the cause of the spin does not go away in the air.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees

from kybflow.core.signals import NS, Alarm, Reaction, ReactionName, Tick
from kybflow.core.units import DEG, AngularRate
from kybflow.flight.tracked_pose import MAX_EXTRAPOLATION_S
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_AVERAGING_S = 0.25
_MEASURABLE_RATE, _USUAL_RATE = 2000.0 * DEG, 10.0 * DEG
"""Range of usual gyroscopes, and rate at which gusts and take-offs turn a vehicle, rad/s."""


@params
class SpinParams:
    limit: AngularRate = param(
        "Largest turn rate beyond the setpoint's.", default=360.0 * DEG, above=0.0, tightens="down"
    )
    reaction: ReactionName = param("What the failsafe does.", default="land", tightens="up")


class Spin(Supervisor[SpinParams]):
    always = True
    unhurried = True
    events = ("spinning",)

    @classmethod
    def objections(cls, params: SpinParams, context: VehicleContext) -> Iterator[Objection]:
        if params.limit > _MEASURABLE_RATE:
            reason = "never alarms: no gyroscope measures such a rate"
            yield Objection("limit", reason, "write `limit: 360 deg/s`", is_doubt=True)
        if params.limit < _USUAL_RATE:
            reason = "alarms when gusts turn the vehicle a little"
            yield Objection("limit", reason, "write `limit: 360 deg/s`", is_doubt=True)

    def __init__(self, params: SpinParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._rate, self._looked, self._spins = 0.0, 0, False

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        estimate, setpoint, now = tick.estimate, tick.setpoint, tick.now
        dt, self._looked = (now - self._looked) / NS, now
        if estimate is None or not off_ground:
            self._rate, self._spins = 0.0, False
            return None
        rate = self._rate
        if estimate.age <= MAX_EXTRAPOLATION_S:
            asked = 0.0 if setpoint is None else setpoint.heading_rate
            rate = estimate.angular_velocity[2] - asked
        self._rate += (rate - self._rate) * dt / (_AVERAGING_S + dt)
        spin, limit = abs(self._rate), self.params.limit
        self._spins = self._spins or spin > limit
        if not self._spins:
            return None
        reason = f"it spins by {degrees(spin):.0f} deg/s, {degrees(limit):.0f} deg/s allowed"
        return Alarm("spinning", Reaction[self.params.reaction.upper()], reason, spin, limit)
