"""Report poses in another frame than the declared one.

Alarm `mocap_frame_wrong` in the air when the motion by motion capture differs from that by the IMU
(`kybflow.flight.frame_check`): the stream's units or axes are not as declared, or the body's
definition is rotated. It is checked from the take-off on, within tenths of a second of a motion
that shows it: vertical errors show when the vehicle lifts off, horizontal ones when it moves
sideways. The alarm then lasts for as long as the vehicle flies. Without an IMU that gives 22
samples a second or more, nothing is checked; the preflight says so.

The default reaction is `land_blind`: the IMU is right, and every position is wrong.
"""

from __future__ import annotations

from kybflow.core.signals import Alarm, Reaction, ReactionName, Tick
from kybflow.parts import Supervisor, param, params


@params
class MocapFrameSupervisorParams:
    reaction: ReactionName = param("What the failsafe does.", default="land_blind", tightens="up")


class MocapFrameSupervisor(Supervisor[MocapFrameSupervisorParams]):
    always = True
    unhurried = True
    events = ("mocap_frame_wrong",)

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        wrong = tick.wrong_frame
        if wrong is None or not off_ground:
            return None
        reason, value, bound = wrong
        reaction = Reaction[self.params.reaction.upper()]
        return Alarm("mocap_frame_wrong", reaction, reason, value, bound, is_failure=True)
