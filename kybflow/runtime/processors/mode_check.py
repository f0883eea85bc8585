"""Refuse kinds of setpoint that the mission doesn't allow.

TeleKyb's XMModeCheck, with its defaults: setpoints of position and of velocity pass, setpoints of
acceleration are refused, because nothing limits the resulting position. A mission whose behaviors
or earlier processors give a refused kind does not compile (KYB301). That includes the built-in
behaviors: `brake` and `hover` need positions. If a refused kind still arrives in flight, after an
option was changed, an alarm requests the failsafe to brake. (TeleKyb also refused mixed modes; here
a setpoint has only one kind.) The setpoint itself passes unchanged.
"""

from __future__ import annotations

from typing import ClassVar

from kybflow.core.signals import Alarm, Reaction, Setpoint, SetpointKind, Tick
from kybflow.parts import Processor, param, params


@params
class ModeCheckParams:
    position: bool = param("Pass position setpoints.", default=True, tightens="down")
    velocity: bool = param("Pass velocity setpoints.", default=True, tightens="down")
    acceleration: bool = param("Pass acceleration setpoints.", default=False, tightens="down")

    def lets_pass(self, kind: SetpointKind) -> bool:
        if kind is SetpointKind.POSITION:
            return self.position
        if kind is SetpointKind.VELOCITY:
            return self.velocity
        return self.acceleration or kind is not SetpointKind.ACCELERATION


class ModeCheck(Processor[ModeCheckParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        kind: kind
        for kind in (SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION)
    }
    safety = True
    events = ("setpoint_kind_refused",)

    @classmethod
    def takes(cls, params: ModeCheckParams) -> dict[SetpointKind, SetpointKind]:
        return {kind: given for kind, given in cls.accepts.items() if params.lets_pass(kind)}

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm:
        if self.params.lets_pass(setpoint.kind):
            return setpoint
        reason = f"setpoints of {setpoint.kind.value} are refused"
        return Alarm("setpoint_kind_refused", Reaction.BRAKE, reason, 1.0, 0.0)
