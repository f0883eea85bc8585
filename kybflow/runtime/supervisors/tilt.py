"""Report a vehicle that is tilted further than any command would tilt it.

Alarm `tilted` in the air while the angle between body z and world z is more than `limit`; once
raised it stays until the angle is 5 deg smaller. Trackers stay under the airframe's own limit,
which is far below this one. Without an estimate, or while its newest measurement is older than 0.1
s, nothing is reported, because the present attitude is unknown. Radians.

The default reaction is `land_blind`, which commands a level attitude and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees, pi

from kybflow.core.geometry import tilt_of
from kybflow.core.signals import Alarm, Reaction, ReactionName, Tick
from kybflow.core.units import DEG, Angle
from kybflow.flight.tracked_pose import MAX_EXTRAPOLATION_S
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_HYSTERESIS = 0.087
_HOVERING_TILT = 0.05
"""Tilt (rad) of a vehicle that only hovers in a draught."""


@params
class TiltSupervisorParams:
    limit: Angle = param(
        "Largest tilt.", default=60.0 * DEG, above=0.0, below=3.14, tightens="down"
    )
    reaction: ReactionName = param("What the failsafe does.", default="land_blind", tightens="up")


class TiltSupervisor(Supervisor[TiltSupervisorParams]):
    always = True
    unhurried = True
    events = ("tilted",)

    @classmethod
    def ends_outside(cls, params: TiltSupervisorParams) -> Mapping[str, tuple[float, float]]:
        ends = Reaction[params.reaction.upper()] > Reaction.BRAKE
        return {"state.tilt": (0.0, params.limit)} if ends else {}

    @classmethod
    def objections(
        cls, params: TiltSupervisorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        own, limit = context.airframe.tilt, params.limit
        if limit <= own:
            reason = f"alarms in curves: the airframe may tilt {degrees(own):.3g} deg"
            yield Objection("limit", reason, "write `limit: 60 deg`", limit > _HOVERING_TILT)
        if limit > 0.5 * pi:
            reason = "alarms when the vehicle is upside down, which is too late"
            yield Objection("limit", reason, "write `limit: 60 deg`", is_doubt=True)

    def __init__(self, params: TiltSupervisorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._tilted = False

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if tick.estimate is None or tick.estimate.age > MAX_EXTRAPOLATION_S or not off_ground:
            self._tilted = False
            return None
        tilt, limit = tilt_of(tick.estimate.attitude), self.params.limit
        self._tilted = tilt > (limit - _HYSTERESIS if self._tilted else limit)
        if not self._tilted:
            return None
        reason = f"tilted by {degrees(tilt):.0f} deg, {degrees(limit):.0f} deg allowed"
        return Alarm("tilted", Reaction[self.params.reaction.upper()], reason, tilt, limit)
