"""Report a setpoint that no vehicle can follow.

The setpoint that the tracker followed in the last tick is checked 50 times a second, in the air.
Alarm `setpoint_jumped` when it is more than `step` from where the previously checked one would have
moved in the time dt between them, |p - (p' + v' dt)| > step, and also more than `step` from the
vehicle; a setpoint that jumps to the vehicle does no harm, as at the beginning of a hold. This
alarm lasts 0.1 s. Alarm `setpoint_left` while the setpoint is more than `distance` from the
estimate. A setpoint without a position is not checked; one that is not finite fails its behavior
before any supervisor receives it. World frame, metres.

The default reaction is `brake`: the vehicle holds its position and continues from there.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.geometry import ZERO, add, distance, scale
from kybflow.core.signals import NS, Alarm, Reaction, ReactionName, Setpoint, Tick, Time
from kybflow.core.units import Length
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_ALARM_TIME_NS = NS // 10
_USUAL_DEVIATION = 0.02
"""Distance (m) from its setpoint within which a vehicle mostly stays in still air."""


@params
class SetpointSupervisorParams:
    step: Length = param("Largest step between two ticks.", default=0.5, above=0.0, tightens="down")
    distance: Length = param(
        "Largest distance from the vehicle.", default=1.0, above=0.0, tightens="down"
    )
    reaction: ReactionName = param("What the failsafe does.", default="brake", tightens="up")


class SetpointSupervisor(Supervisor[SetpointSupervisorParams]):
    always = True
    unhurried = True
    events = ("setpoint_jumped", "setpoint_left")

    @classmethod
    def objections(
        cls, params: SetpointSupervisorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        fence = context.fence
        for name, usual in ("step", "50 cm"), ("distance", "1 m"):
            bound: float = getattr(params, name)
            if bound < _USUAL_DEVIATION:
                reason = f"alarms at once: good tracking leaves {_USUAL_DEVIATION * 100:.0f} cm"
                yield Objection(name, reason, f"write `{name}: {usual}`", is_doubt=True)
            if fence is not None and bound > min(fence.size[:2]):
                reason = f"alarms beyond the walls: the fence is {min(fence.size[:2]):.3g} m wide"
                yield Objection(name, reason, f"write `{name}: {usual}`", is_doubt=True)

    def __init__(self, params: SetpointSupervisorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._last: Setpoint | None = None
        self._looked: Time = 0
        self._jumped: Alarm | None = None
        self._until: Time = 0

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        last, setpoint, estimate = self._last, tick.setpoint, tick.estimate
        dt = (tick.now - self._looked) / NS
        self._last, self._looked = setpoint, tick.now
        if not off_ground or setpoint is None or estimate is None:
            return None
        position, p = setpoint.position, self.params
        if position is None:
            return None
        away = distance(position, estimate.position)
        if away > p.step and last is not None and last.position is not None:
            gone = add(last.position, scale(last.velocity or ZERO, dt))
            step, bound = distance(position, gone), p.step
            if step > bound:
                reason = f"its setpoint stepped by {step:.2f} m, {bound:g} m allowed"
                self._jumped = Alarm("setpoint_jumped", self._reaction, reason, step, bound)
                self._until = tick.now + _ALARM_TIME_NS
        if self._jumped is not None and tick.now < self._until:
            return self._jumped
        if away > p.distance:
            bound = p.distance
            reason = f"its setpoint is at a distance of {away:.2f} m, {bound:g} m allowed"
            return Alarm("setpoint_left", self._reaction, reason, away, bound)
        return None

    @property
    def _reaction(self) -> Reaction:
        return Reaction[self.params.reaction.upper()]
