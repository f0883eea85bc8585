"""Report a link that has fallen silent.

Alarm `link_lost` in the air while nothing at all has arrived for longer than `age`, no measurement
and no report. What can't be heard can't be commanded either: the vehicle's own watchdog acts then.
The value is the silence in seconds.

The default reaction is `land`, or `land_blind` where by then there is no estimate.
"""

from __future__ import annotations

from kybflow.core.signals import Alarm, Reaction, ReactionName, Tick
from kybflow.core.units import Duration
from kybflow.parts import Supervisor, param, params


@params
class LinkSupervisorParams:
    age: Duration = param("Longest silence.", default=0.5, above=0.0, tightens="down")
    reaction: ReactionName = param("What the failsafe does.", default="land", tightens="up")


class LinkSupervisor(Supervisor[LinkSupervisorParams]):
    always = True
    unhurried = True
    events = ("link_lost",)

    def check(self, tick: Tick, airborne: bool) -> Alarm | None:
        silence, bound = tick.link_age, self.params.age
        if not airborne or silence <= bound:
            return None
        reason = f"nothing has arrived for {silence:.2f} s, {bound:g} s allowed"
        return Alarm("link_lost", Reaction[self.params.reaction.upper()], reason, silence, bound)
