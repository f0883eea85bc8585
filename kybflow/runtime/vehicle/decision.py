"""Decides what a vehicle does: supervisors first, then requests, then the mission's transitions."""

from __future__ import annotations

from kybflow.core.signals import Reaction, Tick, Time
from kybflow.parts import AIR, GROUND
from kybflow.runtime.safety.failsafe import Failsafe
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.control import Control
from kybflow.runtime.vehicle.knowledge import Knowledge
from kybflow.runtime.vehicle.output import CommandOutput
from kybflow.runtime.vehicle.reactions import Reactions
from kybflow.runtime.vehicle.requests import Requests


class Decision:
    """Changes the state of `activity` and adapts the other collaborators to the new state."""

    def __init__(
        self,
        activity: Activity,
        failsafe: Failsafe,
        reactions: Reactions,
        requests: Requests,
        control: Control,
        output: CommandOutput,
        knowledge: Knowledge,
    ) -> None:
        self._activity, self._failsafe, self._reactions = activity, failsafe, reactions
        self._requests, self._control, self._output = requests, control, output
        self._knowledge = knowledge

    def decide(self, tick: Tick) -> Tick:
        """Decide on the state; return the tick for its behavior."""
        activity = self._activity
        if activity.hold is not None:
            activity.wait(tick.dt)
        if tick.now >= self._failsafe.due:
            heard = self._failsafe.check(tick, activity.off_ground)
            if heard is not None:
                self._reactions.react(heard, tick)
        if self._failsafe.latched is Reaction.LAND_BLIND:
            self._reactions.regain_sight(tick)
        if activity.changed:
            tick = self.settle(tick)
        if self._requests.waiting:
            self.answer(tick.now)
        if activity.hold is not None:
            self._reactions.update_hold(tick.now)
        elif not activity.changed:
            activity.step(tick)
        return self.settle(tick) if activity.changed else tick

    def answer(self, now: Time) -> None:
        """Answer the waiting requests."""
        if self._requests.waiting:
            self._requests.answer(now)
            self._control.select(self._requests.off)

    def settle(self, tick: Tick) -> Tick:
        """Adapt everything to a state that was entered; return the tick for its behavior."""
        activity = self._activity
        if not activity.changed:
            return tick
        activity.changed = False
        self._output.arming = None
        if activity.leg.start is GROUND and activity.leg.end is AIR:
            self._control.renew()
        self._control.select(self._requests.off)
        self._knowledge.link_in.subscribe(activity.state.behavior.cls.needs)
        self._knowledge.estimation.prefer(activity.state.estimators)
        return tick._replace(elapsed=0.0)
