"""Turns the active behavior into commands: behavior ─► processors ─► tracker ─► command.

Processors and tracker are constructed anew for each take-off, so that they keep no state of the
last flight.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from contextlib import suppress
from typing import Any

from kybflow.core.errors import OptionRefused, PartError, PartFailed, Refused
from kybflow.core.events import Emitting
from kybflow.core.signals import Alarm, Command, Retune, Setpoint, SetpointKind, Tick, Time
from kybflow.dsl.plan import PartPlan, VehiclePlan
from kybflow.parts import Processor, Tracker
from kybflow.parts.events import LandModeRefused
from kybflow.runtime.events import Events
from kybflow.runtime.finite import checked_command, checked_setpoint
from kybflow.runtime.making import make
from kybflow.runtime.safety.clamps import Clamps
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.output import HANDED_OVER, RESTING, CommandOutput
from kybflow.runtime.vehicle.reactions import Reactions
from kybflow.world.vehicle_context import VehicleContext

Commanded = tuple[Command, Setpoint | None]
"""(the command of a tick, the setpoint before processing)."""

OptionSetter = Callable[[str, Any, str, str], None]
"""Asks for another value of an option: its name, the value (SI), who asks and the mission line.
Raises OptionRefused after the event `option_refused`."""

_Process = Callable[[Setpoint, Tick], Setpoint | Alarm | Emitting | Retune]
_MORE = (Emitting, Retune)
_IDLE = SetpointKind.IDLE
_LEAST_HOVER, _MOST_HOVER = 0.5, 2.0
"""Plausible range of a tracker's hover thrust, as a fraction of the airframe's weight."""


class Control:
    """Runs the active behavior, the processors and the tracker of a vehicle.

    followed: the setpoint that the tracker followed last, None without one. set_option: asks for
    what a processor retunes. Raises PartFailed for a part that can't be constructed.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        params: dict[str, Any],
        activity: Activity,
        reactions: Reactions,
        output: CommandOutput,
        events: Events,
    ) -> None:
        self.followed: Setpoint | None = None
        self.set_option: OptionSetter = _nobody_sets
        self._plan, self._context, self._params = plan, context, params
        self._activity, self._reactions, self._output = activity, reactions, output
        self._events = events
        self._parts = parts = {part.label: part for part in plan.processors}
        self._clamping = frozenset(label for label, part in parts.items() if part.cls.clamps)
        self._clamps = Clamps(
            plan.name,
            {label: part.name for label, part in parts.items()},
            {label: part.at for label, part in parts.items()},
            events,
        )
        self._tracker_label = plan.tracker.label
        self._raised = ""
        self.renew()

    def renew(self) -> None:
        """Construct the processors and the tracker anew."""
        params, context = self._params, self._context
        processors: dict[str, Processor[Any]] = {
            part.label: make(part, params[part.label], context) for part in self._plan.processors
        }
        tracker: Tracker[Any] = make(self._plan.tracker, params[self._tracker_label], context)
        self._processors, self._tracker = processors, tracker
        self._active: tuple[tuple[str, _Process], ...] = ()

    def select(self, off: Set[str]) -> None:
        """Select the processors of the active behavior: all if it stays in the air, only those for
        safety if it takes off or lands; never those whose labels are in `off`."""
        in_air = self._activity.stays_in_air
        self._active = tuple(
            (label, processor.__call__)  # faster than calling the object
            for label, processor in self._processors.items()
            if (in_air or processor.safety) and label not in off and not processor.idle
        )

    def steer(self, tick: Tick) -> Commanded | None:
        """Return the command of this tick, None if the state changed and `steer` must be called
        again. Raises whatever a part raises, and ValueError for a setpoint or a command that is not
        finite or would stop the rotors in the air."""
        activity = self._activity
        if self._clamps.active:
            self._clamps.settle(tick.now)
        if self._output.arming is not None:
            activity.wait(tick.dt)
            return self._kept(self._output.arming, tick), None
        if activity.land_mode is not None:
            return self._landing(tick)
        if tick.estimate is None and activity.behavior.needs_estimate:
            if activity.off_ground and self._reactions.lost_estimate(tick):
                return None  # `followed` stays: what is entered begins at its speed
            self.followed = None
            if not activity.off_ground:
                return RESTING, None
        output = activity.update(tick)
        if isinstance(output, Command):
            self.followed = None
            return self._turning(checked_command(output)), None
        if output.kind is _IDLE:
            if activity.off_ground:
                raise ValueError("the rotors can't rest in the air")
            self.followed = None
            return RESTING, output
        command = self._tracked(checked_setpoint(output), tick)
        return None if command is None else (command, output)

    def _kept(self, waiting: Command, tick: Tick) -> Command:
        """The command that waits for arming, tracked anew: the vehicle may be on its way up, where
        the wind takes it."""
        if self.followed is None or tick.estimate is None:
            return waiting
        self._raised = self._tracker_label
        command = checked_command(self._tracker.update(self.followed, tick))
        self._raised = ""
        return command

    def _tracked(self, setpoint: Setpoint, tick: Tick) -> Command | None:
        """Process and track a setpoint; return None if a processor's alarm changed the state."""
        part = ""
        try:
            for part, process in self._active:
                output = process(setpoint, tick)
                if output is setpoint:
                    continue  # as nearly always
                if isinstance(output, Alarm):
                    processor, part = part, ""  # noqa: PLW2901 - what raises is not the processor
                    if self._reactions.alarm(processor, output, tick):
                        return None
                else:
                    given = self._said(part, output) if isinstance(output, _MORE) else output
                    setpoint = self._bent(part, setpoint, checked_setpoint(given), tick.now)
            part = self._tracker_label
            command = checked_command(self._tracker.update(setpoint, tick))
        except Exception:
            self._raised = part
            raise
        self.followed = setpoint
        return command if command.armed else self._turning(command)

    def _bent(self, label: str, asked: Setpoint, given: Setpoint, now: Time) -> Setpoint:
        """Return what the processor `label` made of a setpoint; report it where that is a clamp."""
        if label in self._clamping:
            reason = self._clamps.note(label, asked, given, now)
            if reason is not None:
                self._activity.keep_from(reason)
        return given

    def _said(self, label: str, said: Emitting | Retune) -> Setpoint:
        """Do what a processor says besides its setpoint, and return that. Raises PartError for what
        it doesn't declare."""
        part = self._parts[label]
        if isinstance(said, Emitting):
            return self._emitted(part, said)
        return self._retuned(part, said)

    def _retuned(self, part: PartPlan, retune: Retune) -> Setpoint:
        """Ask for other values of the tracker's options; who refuses them emits that."""
        undeclared = retune.options.keys() - part.cls.retunes
        if undeclared or not isinstance(retune.output, Setpoint):
            named = ", ".join(f"`{option}`" for option in sorted(undeclared))
            raise PartError(f"{named or repr(retune.output)} is nothing that it retunes")
        for option, value in retune.options.items():
            name = f"{self._plan.name}.{self._tracker_label}.{option}"
            with suppress(OptionRefused):
                self.set_option(name, value, f"processor {part.name}", part.at)
        return retune.output

    def _emitted(self, part: PartPlan, emitting: Emitting) -> Setpoint:
        """Emit an event of a processor's own."""
        output, event = emitting
        if type(event) not in part.cls.own_events or not isinstance(output, Setpoint):
            raise PartError(f"`{event.name}` with {output!r} is nothing that it emits")
        self._events.emit(event.replaced(processor=part.name), self._plan.name, part.at)
        return output

    def _turning(self, command: Command) -> Command:
        if not command.armed and self._activity.off_ground:
            raise ValueError("the rotors can't rest in the air")
        return command

    def _landing(self, tick: Tick) -> Commanded | None:
        """Land by the vehicle's own land mode; if it refuses, enter the current state again."""
        self.followed = None
        activity, plan = self._activity, self._plan
        try:
            landed = activity.has_landed(tick.now, tick.estimate)
        except Refused as refusal:
            refused = LandModeRefused(reason=str(refusal))
            self._events.emit(refused, plan.name, plan.driver.at)
            activity.go(activity.machine.state)
            return None
        return (RESTING if landed else HANDED_OVER), None

    def blame(self, error: Exception) -> tuple[PartFailed, bool]:
        """Return the failure of the part that raised `error`, and whether the vehicle needs it to
        fly. A processor is not needed and is removed."""
        part, self._raised = self._raised or self._activity.state.behavior.label, ""
        failure = error if isinstance(error, PartFailed) else PartFailed(part, error)
        self._active = tuple(active for active in self._active if active[0] != failure.part)
        return failure, self._processors.pop(failure.part, None) is None

    def hover_thrust(self) -> float:
        """Return the thrust that holds the vehicle (N): in the air the tracker's estimate if
        that is plausible, else the airframe's weight."""
        weight = self._context.airframe.hover_thrust
        if not self._activity.off_ground:
            return weight
        try:
            believed = self._tracker.hover_thrust
        except Exception:  # land_blind must be able to start without a tracker
            return weight
        return believed if _LEAST_HOVER <= believed / weight <= _MOST_HOVER else weight

    def parts(self) -> dict[str, Any]:
        """Return the processors and the tracker by label."""
        return {**self._processors, self._tracker_label: self._tracker}


def _nobody_sets(name: str, *_: Any) -> None:
    """Stand in until there are options."""
    raise OptionRefused(f"nothing here sets `{name}`")
