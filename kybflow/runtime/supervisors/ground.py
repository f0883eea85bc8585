"""Report a vehicle that is on the ground while it should fly.

Alarm `ground_touched` when all of this has been true for half a second: the vehicle has flown (more
than 15 cm above where it last stood); it is within 5 cm of that height, or below it; it climbs or
sinks by less than 5 cm/s; and its setpoint is not that of a vehicle which flies there. Such a
setpoint doesn't sink, as that of a landing does, and either is more than `gap` above or below the
vehicle, or lies on the ground as well (less than 5 cm above the floor, the start or an obstacle
below the vehicle), where a brake may have come to rest; or it has no position and climbs by more
than 10 cm/s. A vehicle that came down on a table, for example, is not detected. World frame,
metres.

The default reaction is `land`, which soon stops the rotors: the cause may bring the vehicle down
again. The mission has then failed, however softly the vehicle came down.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.signals import NS, Alarm, Estimate, Reaction, ReactionName, Setpoint, Tick, Time
from kybflow.core.units import Length
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.ground import STAND_HEIGHT, height_above_ground
from kybflow.world.vehicle_context import VehicleContext

_FLOWN_HEIGHT, _NEAR_HEIGHT = 0.15, 0.05
_STILL_SPEED, _CLIMB_SPEED, _SINK_SPEED = 0.05, 0.1, -0.05
_CONTACT_TIME_NS = NS // 2


@params
class GroundParams:
    gap: Length = param(
        "Height difference between the setpoint and a vehicle that doesn't follow it.",
        default=0.1, above=0.0, tightens="down",
    )  # fmt: skip
    reaction: ReactionName = param("What the failsafe does.", default="land", tightens="up")


class Ground(Supervisor[GroundParams]):
    always = True
    unhurried = True
    events = ("ground_touched",)

    @classmethod
    def objections(cls, params: GroundParams, context: VehicleContext) -> Iterator[Objection]:
        fence = context.fence
        if fence is not None and params.gap > fence.size[2]:
            reason = f"never alarms: the fence is {fence.size[2]:.3g} m high"
            yield Objection("gap", reason, "write `gap: 10 cm`", is_doubt=True)

    def __init__(self, params: GroundParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._context = context
        self._near, self._has_flown = context.start[2] + _NEAR_HEIGHT, False
        self._since: Time | None = None

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        estimate = tick.estimate
        if estimate is None:
            return None
        height = estimate.position[2]
        if not off_ground:
            self._near, self._has_flown, self._since = height + _NEAR_HEIGHT, False, None
            return None
        if height > self._near:
            self._has_flown = self._has_flown or height > self._near - _NEAR_HEIGHT + _FLOWN_HEIGHT
            self._since = None
            return None
        if abs(estimate.velocity[2]) > _STILL_SPEED or not self._leaves(tick.setpoint, estimate):
            self._since = None
            return None
        self._since = tick.now if self._since is None else self._since
        if tick.now - self._since < _CONTACT_TIME_NS:
            return None
        reaction = Reaction[self.params.reaction.upper()]
        reason = "it is on the ground, but should fly"
        return Alarm("ground_touched", reaction, reason, is_failure=True)

    def _leaves(self, setpoint: Setpoint | None, estimate: Estimate) -> bool:
        """Return whether a vehicle that has flown should not be on the ground: its setpoint is too
        far above or below it, climbs, or is at ground level without a landing."""
        if setpoint is None or not self._has_flown:
            return False
        climb = 0.0 if setpoint.velocity is None else setpoint.velocity[2]
        if setpoint.position is None:
            return climb > _CLIMB_SPEED
        if climb <= _SINK_SPEED:
            return False
        off = setpoint.position[2] - estimate.position[2]
        if abs(off) > self.params.gap:
            return True
        above = height_above_ground(self._context, estimate.position, estimate.attitude)
        return above + off < STAND_HEIGHT
