"""Report poses in another frame than the declared one.

Alarm `mocap_frame_wrong` in the air when the motion by motion capture differs from that by the IMU
(`kybflow.flight.frame_check`): the stream's units or axes are not as declared, or the body's
definition is rotated. It is checked from the take-off on, within tenths of a second of a motion
that shows it: vertical errors show when the vehicle lifts off, horizontal ones when it moves
sideways. The alarm then lasts for as long as the vehicle flies. Without an IMU that gives 22
samples a second or more, nothing is checked; the preflight says so.

If poses come for a second after the take-off and none can be compared, because poses or IMU samples
are lost or far too late, the alarm is `mocap_frame_unchecked`, by default with the same reaction: a
wrong frame that nobody sees makes the vehicle climb away within seconds. A vehicle that lands blind
goes on to land by its estimate once the comparison shows that the frame is right.

An autopilot judges the poses that it is sent too: it reports their innovations, which is how far
they are from what its own filter expects by its IMU. If it rejects poses for half a second, the
alarm is `poses_rejected`, by default with the reaction `warn`, because a late stream looks the
same. The reason of a `mocap_frame_wrong` mentions it.

The default reaction is `land_blind`: the IMU is right, and every position is wrong. An autopilot
that takes its position from kybflow is then sent none any more, and is not put into its own land
mode: its filter has taken the wrong poses. kybflow lands it by attitude and thrust. For the first
seconds of a flight its IMU is requested 100 times a second, so that the frame is judged sooner.
"""

from __future__ import annotations

from kybflow.core.signals import Alarm, Reaction, ReactionName, Tick
from kybflow.flight.frame_check import MAX_UNCOMPARED_S
from kybflow.parts import Supervisor, param, params

_WHY = (
    "for a second, no pose could be compared with the IMU, whose samples or the poses are lost or"
    " late: check both streams, and that the computer is not overloaded"
)


@params
class MocapFrameSupervisorParams:
    reaction: ReactionName = param("What the failsafe does.", default="land_blind", tightens="up")
    unchecked: ReactionName = param(
        "What the failsafe does when the frame can't be checked after the take-off.",
        default="land_blind", tightens="up",
    )  # fmt: skip
    rejected: ReactionName = param(
        "What the failsafe does when an autopilot's filter rejects the poses.",
        default="warn", tightens="up",
    )  # fmt: skip


class MocapFrameSupervisor(Supervisor[MocapFrameSupervisorParams]):
    always = True
    unhurried = True
    events = ("mocap_frame_wrong", "mocap_frame_unchecked", "poses_rejected")

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if not off_ground:
            return None
        rejection = tick.rejection or ""
        if tick.wrong_frame is None:
            if tick.uncompared > MAX_UNCOMPARED_S:
                return Alarm("mocap_frame_unchecked", Reaction[self.params.unchecked.upper()], _WHY)
            if not rejection:
                return None
            return Alarm("poses_rejected", Reaction[self.params.rejected.upper()], rejection)
        reason, value, bound = tick.wrong_frame
        reason += rejection and f"; {rejection}"
        reaction = Reaction[self.params.reaction.upper()]
        return Alarm("mocap_frame_wrong", reaction, reason, value, bound, is_failure=True)
