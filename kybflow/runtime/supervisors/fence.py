"""Report a vehicle that has left the mission's fence.

Alarm `fence_breached` while the estimate is more than `margin` beyond a face of the fence. Once
raised, the alarm stays until the vehicle is back inside by 5 cm, so that it does not flutter. The
floor is the fence's floor or the ground at the start, whichever is lower, because take-off and
landing cross the fence's. The floor is not checked while the vehicle is commanded to descend, by a
setpoint below the floor or a sinking one without a position, or while a pilot or another program
controls it: the ground may be lower where it touches down, and the alarm would only request a
landing. Nothing is reported on the ground, without an estimate, or without a fence in the mission.

The default reaction is to land: the processor of the same name keeps the setpoint inside, so a
vehicle that is outside does not follow its setpoint, and would not hold a position either. An alarm
that persists is returned in every tick; the failsafe makes one event of it. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.signals import Alarm, Reaction, ReactionName, Setpoint, Tick
from kybflow.core.units import Length
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import VehicleContext

_BACK_INSIDE = 0.05


@params
class FenceSupervisorParams:
    margin: Length = param(
        "Largest distance beyond the fence.", default=0.1, at_least=0.0, tightens="down"
    )
    reaction: ReactionName = param("What the failsafe does.", default="land", tightens="up")


class FenceSupervisor(Supervisor[FenceSupervisorParams]):
    always = True
    unhurried = True
    events = ("fence_breached",)

    @classmethod
    def objections(
        cls, params: FenceSupervisorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        fence, margin = context.fence, params.margin
        if fence is not None and margin > min(fence.size):
            reason = f"alarms {margin:.3g} m beyond a fence of {min(fence.size):.3g} m"
            yield Objection("margin", reason, "write `margin: 10 cm`", is_doubt=True)

    @classmethod
    def can_emit(cls, context: VehicleContext) -> tuple[str, ...]:
        return cls.events if context.fence is not None else ()

    def __init__(self, params: FenceSupervisorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._outside = False
        self._box = None
        if context.fence is not None:
            low, high = context.fence
            x, y, z = low
            self._floor = min(z, context.start[2])
            self._box = Box((x, y, self._floor), high)

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if self._box is None or tick.estimate is None or not off_ground:
            self._outside = False
            return None
        position, floor = tick.estimate.position, self._floor
        if position[2] < floor and _comes_down(tick.setpoint, floor):
            position = (position[0], position[1], floor + _BACK_INSIDE)
        beyond = self._box.outside_by(position)
        bound = self.params.margin
        self._outside = beyond > (-_BACK_INSIDE if self._outside else bound)
        if not self._outside:
            return None
        reason = f"{beyond:.2f} m beyond the fence, {bound:g} m allowed"
        if beyond <= bound:
            reason = "not back inside the fence"
        reaction = Reaction[self.params.reaction.upper()]
        return Alarm("fence_breached", reaction, reason, beyond, bound)


def _comes_down(setpoint: Setpoint | None, floor: float) -> bool:
    """Return whether a vehicle below the floor is commanded to descend, or not commanded at all."""
    if setpoint is None:
        return True
    if setpoint.position is None:
        return setpoint.velocity is not None and setpoint.velocity[2] < 0.0
    return setpoint.position[2] < floor
