"""Tracks who controls the vehicle: this program, a pilot, or the vehicle's own failsafe.

While a pilot has control, the runtime sends no commands and freezes the behavior. `operator.resume`
requests control back: either the behavior resumes from the vehicle's current position, or an event
reports why the request was refused. If the vehicle's own failsafe takes control, the runtime lands
the vehicle.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.events import VehicleEvent
from kybflow.core.signals import Alarm, Reaction, Tick, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Override
from kybflow.parts.events import ControlLost, ControlRefused, ControlReturned, ControlTaken
from kybflow.runtime.events import Events
from kybflow.runtime.safety.failsafe import Failsafe, RaisedAlarm
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.arming_watch import ArmingWatch
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner
from kybflow.runtime.vehicle.control import Control
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.runtime.vehicle.reactions import Reactions


class ManualOverride:
    """Tracks who has control of a vehicle. away: whether a pilot has control."""

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        runner: BehaviorRunner,
        failsafe: Failsafe,
        reactions: Reactions,
        control: Control,
        arming: ArmingWatch,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self.away = False
        self._plan, self._link, self._runner, self._failsafe = plan, link, runner, failsafe
        self._reactions, self._control = reactions, control
        self._arming, self._events, self._score = arming, events, score
        self._landed_for: Override | None = None
        self._lost: Override | None = None
        self._refused = ""

    @property
    def is_taken(self) -> bool:
        """Whether a person has control, or had it when the vehicle landed."""
        override = self._link.override
        return self.away or (override is not None and not override.lands)

    def reclaim(self, now: Time) -> None:
        """Request control back from a person."""
        if self.is_taken:
            self._refused = ""
            self._link.reclaim(now)

    def update(self, tick: Tick, answer: Callable[[Time], None]) -> bool:
        """Determine who has control in this tick and whether the vehicle falls. Return whether a
        pilot has control. answer: handles the waiting requests while a pilot has control."""
        armed = self._link.armed
        if armed is not None and self._arming.update(tick, armed):
            self.away = False
        elif self.away or self._link.override is not None:
            self._follow(tick, answer)
        return self.away

    def _follow(self, tick: Tick, answer: Callable[[Time], None]) -> None:
        override = self._link.override
        if override is None or not self._runner.off_ground:
            self._lost = None
            if self.away:
                self._emit(ControlReturned())
                self._take_back()
        elif override.lands:
            self._take_back()
            if override != self._lost:
                self._lost = override
                self._emit(ControlLost(reason=override.reason))
            lost = Alarm("control_lost", Reaction.LAND, override.reason)
            self._reactions.react(RaisedAlarm(lost, self._plan.driver.at), tick)
            self._bring_down(override, tick.now)
        else:
            self._stand_by(override, tick, answer)

    def _stand_by(self, override: Override, tick: Tick, answer: Callable[[Time], None]) -> None:
        """Freeze the behavior once, handle requests, and detect that the pilot landed."""
        runner = self._runner
        if not self.away:
            self.away = True
            self._control.rest()
            self._emit(ControlTaken(reason=override.reason))
            runner.freeze("pilot")
            if runner.hold is not None:  # the failsafe doesn't brake a vehicle that a pilot flies
                self._failsafe.clear_brake()
                runner.hold.leave("brake", tick.now)
        if override.refused and override.refused != self._refused:
            self._emit(ControlRefused(reason=override.refused))
        self._refused = override.refused
        runner.wait(tick.dt)
        self._failsafe.check(tick, airborne=False)  # supervisors keep their state; no reaction
        answer(tick.now)
        if self._link.armed is False and not self._arming.may_fall(tick):
            self.away = False
            self._score.failure(override.reason)
            runner.go("landed", grounded=True)

    def _bring_down(self, override: Override, now: Time) -> None:
        """Request the land mode of a vehicle that doesn't follow commands, once per override."""
        comes_down = self._runner.machine.state in ("auto_land", "land_blind")
        if override is self._landed_for or not (comes_down and self._link.can_land):
            return
        self._landed_for = override
        if self._runner.land_mode is None:
            self._runner.start_land_mode(now)

    def _take_back(self) -> None:
        """Resume the frozen behavior from the vehicle's current position."""
        if self.away:
            self.away = False
            self._runner.thaw("pilot")

    def _emit(self, event: VehicleEvent) -> None:
        self._events.emit(event, self._plan.name, self._plan.driver.at)
