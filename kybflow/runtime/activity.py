"""What a vehicle is doing: its state machine, the behavior that is active and where it is in
flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kybflow.dsl.expressions import Expression
from kybflow.dsl.machine import Outcome, VehicleMachine
from kybflow.dsl.plan import StatePlan, TransitionPlan, VehiclePlan
from kybflow.errors import Refused
from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry, Leg
from kybflow.runtime.events import Events
from kybflow.runtime.outcome import VehicleScore
from kybflow.signals import NS, Command, Done, Failed, Setpoint, Tick, Time

_SAFE = frozenset({"brake", "landed"})
"""Where a vehicle goes when nothing else will start."""

Situation = Callable[[], Entry]
"""Gives what a behavior is entered with, when one is entered."""


class Activity:
    """`flight` is GROUND, AIR, or MOVING while a take-off or a landing is under way or was left.

    `changed` is true from the entry into a state until the vehicle has taken note of it.
    """

    machine: VehicleMachine
    behavior: Behavior[Any]
    leg: Leg

    def __init__(
        self, plan: VehiclePlan, params: dict[str, Any], events: Events, score: VehicleScore
    ) -> None:
        self.plan, self.flight = plan, GROUND
        self.entered: Time = 0
        self.changed = False
        self._params, self._events, self._score = params, events, score
        self._outcome: Outcome = "running"
        self._reason = ""

    def begin(
        self, conditions: Callable[[Expression], Callable[[], bool]], situation: Situation
    ) -> None:
        """Enter the first state."""
        self.machine = VehicleMachine(self.plan, conditions)
        self._enter(situation)

    @property
    def state(self) -> StatePlan:
        return self.plan.states[self.machine.state]

    @property
    def airborne(self) -> bool:
        return self.flight is not GROUND

    @property
    def stays_in_air(self) -> bool:
        return self.leg.start is AIR and self.leg.end is AIR

    def step(self, tick: Tick, latched: bool, situation: Situation) -> None:
        """Take the arrow that is due in this tick, if one is. A latched vehicle that has landed
        rests in `fault`."""
        heard = self._events.heard(self.plan.name)
        transition = self.machine.due(tick.elapsed, heard, self._outcome, tick.dt)
        if transition is None:
            return
        self._leave("done" if transition.cause == "then" else transition.cause, transition)
        if transition.cause in ("failed", "within"):
            self._score_unforeseen(self._reason or f"not done within {transition.after:g} s")
        self.machine.fire(transition)
        if latched and self.machine.state == "landed":
            self.machine.force("fault")
        self._enter(situation)

    def go(self, goal: str, situation: Situation) -> None:
        """Enter a built-in state at once, whatever the mission's arrows say."""
        self._leave("failsafe", None)
        self.machine.force(goal)
        self._enter(situation)

    def update(self, tick: Tick) -> Setpoint | Command:
        """The behavior's output; its end is noted and takes effect in the next tick."""
        output = self.behavior.update(tick)
        if isinstance(output, Done):
            self._end()
            return output.setpoint
        if isinstance(output, Failed):
            self.fail(output.reason)
            return output.setpoint
        return output

    def fail(self, reason: str) -> None:
        """The behavior has failed: it said so, refused to start, or a part of its chain raised."""
        self._outcome, self._reason = "failed", reason

    def close(self, now: Time) -> None:
        """The run is over: the present behavior's figures are complete."""
        self._score.left("run_ended", now / NS)

    def _end(self) -> None:
        """The behavior's normal end: the vehicle is at the far side of its leg."""
        self._outcome = "done"
        start, end = self.leg
        if start is not end:
            self.flight = end
            if end is GROUND or start is GROUND:
                self._events.tell("landed" if end is GROUND else "took_off", self.plan.name)

    def _enter(self, situation: Situation) -> None:
        """Build the behavior of the present state. One that refuses to start has failed."""
        refused: set[str] = set()
        while True:
            self._outcome, self._reason = "running", ""
            state, entry = self.state, situation()
            self.entered, self.changed = entry.now, True
            self._score.entered(state.name, state.behavior.name, entry.now / NS)
            self._tell("behavior_started", state.at, part=state.behavior.name)
            try:
                self._build(state, entry)
                return
            except Refused as refusal:
                if state.name in (refused & _SAFE):
                    raise
                refused.add(state.name)
                self._refused(str(refusal), refused)

    def _build(self, state: StatePlan, entry: Entry) -> None:
        name, cls = state.behavior.name, state.behavior.cls
        leg = next((leg for leg in state.legs if leg.start is self.flight), None)
        if leg is None:
            raise Refused(f"`{name}` can't start while the vehicle is at {self.flight.value}")
        if cls.needs_estimate and entry.estimate is None and not self.airborne:
            raise Refused(f"`{name}` can't start without an estimate")
        self.behavior = cls(self._params[state.behavior.label], entry)
        self.leg = leg
        if leg.start is not leg.end:
            self.flight = MOVING

    def _refused(self, reason: str, refused: set[str]) -> None:
        """Go where `failed` says, but to no state that has refused already."""
        self.fail(reason)
        self._leave("refused", None)
        self._score_unforeseen(reason)
        transition = self.machine.due(0.0, frozenset(), "failed", 0.0)
        if transition is not None and transition.target not in refused:
            self.machine.fire(transition)
        else:
            self.machine.force("brake" if self.airborne else "landed")

    def _score_unforeseen(self, reason: str) -> None:
        """Count the failure when the mission does not say what follows it."""
        arrows = (arrow for arrow in self.state.transitions if arrow.cause == "failed")
        if all(arrow.implied for arrow in arrows):
            self._score.failure(reason)

    def _leave(self, how: str, transition: TransitionPlan | None) -> None:
        at = transition.at if transition is not None else ""
        if self._outcome == "failed":
            self._tell("behavior_failed", at, reason=self._reason)
        self._score.left(how, self._events.now / NS)
        self._tell("behavior_ended", at, how=how)

    def _tell(self, event: str, at: str, **fields: str) -> None:
        self._events.tell(event, self.plan.name, at, behavior=self.machine.state, **fields)
