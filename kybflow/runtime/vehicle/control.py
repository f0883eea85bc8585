"""Turns a behavior's output into a command: setpoint ─► processors ─► tracker ─► command.

New processors and a new tracker are constructed for each take-off, so that they keep no state from
the previous flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from contextlib import suppress
from math import hypot
from typing import Any, NamedTuple, Protocol

from kybflow.core.errors import OptionRefused, PartError, PartFailed
from kybflow.core.events import Emitting
from kybflow.core.geometry import ZERO, add, distance, dot, scale, sub
from kybflow.core.signals import NS, Alarm, Command, Retune, Setpoint, SetpointKind, Tick, Time
from kybflow.core.units import format_measured
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Processor, Tracker
from kybflow.parts.events import ClampEnded, ClampStarted
from kybflow.runtime.events import Events
from kybflow.runtime.finite import checked_command, checked_setpoint
from kybflow.runtime.making import make
from kybflow.runtime.vehicle.link import RESTING
from kybflow.world.vehicle_context import VehicleContext

_MIN_DISTANCE, _LEAST_SPEED = 0.02, 0.05
"""Least deviations that count as a clamp, m and m/s."""
_CLAMP_GAP_NS = NS // 2


class _Clamp(NamedTuple):
    """An active clamp. since: when it began. last: when it last changed a setpoint. most: its
    largest deviation, in `unit`."""

    since: Time
    last: Time
    most: float
    unit: str


class Clamps:
    """Detects clamps: processors that keep a vehicle's setpoint from its behavior's goal.

    A processor that `clamps`, like the fence, cuts off the setpoint at its bound, so that the
    vehicle never reaches a goal beyond it. (With `limit_speed`, `limit_acceleration` and
    `smooth` the vehicle only arrives later, and with an avoidance by a different path; that
    shows only in the errors.) A deviation counts as a clamp from 2 cm on, or from 5 cm/s for
    velocity setpoints. `clamp_started` is emitted when a clamp begins, and `clamp_ended`, with
    its largest deviation and its duration, once the clamp has changed nothing for half a
    second.

    names, lines: the names and mission lines of its processors, by
    label. active: the active clamps, by the label of the processor.
    """

    def __init__(
        self, vehicle: str, names: Mapping[str, str], lines: Mapping[str, str], events: Events
    ) -> None:
        self.active: dict[str, _Clamp] = {}
        self._vehicle, self._names, self._lines, self._events = vehicle, names, lines, events

    def note(self, label: str, asked: Setpoint, given: Setpoint, now: Time) -> str | None:
        """Compare the setpoints before and after a clamping processor. Return a description of how
        it keeps the vehicle from its goal, or None if it doesn't."""
        if asked.position is not None and given.position is not None:
            off, least, unit = distance(asked.position, given.position), _MIN_DISTANCE, "m"
        else:
            off = distance(asked.velocity or ZERO, given.velocity or ZERO)
            least, unit = _LEAST_SPEED, "m/s"
        if off < least:
            return None
        name = self._names[label]
        words = f"`{name}` keeps the setpoint {format_measured(off, unit)} from the requested one"
        clamp = self.active.get(label)
        if clamp is None:
            clamp = _Clamp(now, now, off, unit)
            at = self._lines[label]
            self._events.emit(ClampStarted(processor=name, reason=words), self._vehicle, at)
        self.active[label] = _Clamp(clamp.since, now, max(clamp.most, off), unit)
        return words if unit == "m" else None

    def settle(self, now: Time) -> None:
        """End the clamps that have changed nothing for long enough."""
        over = [label for label, clamp in self.active.items() if now - clamp.last > _CLAMP_GAP_NS]
        for label in over:
            clamp = self.active.pop(label)
            ended = ClampEnded(
                processor=self._names[label],
                most=format_measured(clamp.most, clamp.unit),
                seconds=(clamp.last - clamp.since) / NS,
            )
            self._events.emit(ended, self._vehicle, self._lines[label])


Commanded = tuple[Command, Setpoint | None]
"""(the command of a tick, the behavior's setpoint before the processors)."""

OptionSetter = Callable[[str, Any, str, str], None]
"""Requests a change of an option. Arguments: the option's name, the value (SI), the requester and
its mission line. Emits `option_refused` and raises OptionRefused if the change is refused."""

_Process = Callable[[Setpoint, Tick], Setpoint | Alarm | Emitting | Retune]
_MORE = (Emitting, Retune)
_IDLE = SetpointKind.IDLE
_LEAST_HOVER, _MOST_HOVER, _MOST_LEAN = 0.5, 2.0, 0.2
"""Plausible range of a tracker's hover thrust, as a multiple of the airframe's weight, and its
largest plausible lean."""


class ProcessorReports(Protocol):
    """Receives the alarms and clamps that processors report."""

    def alarm(self, label: str, alarm: Alarm, tick: Tick) -> bool:
        """React to an alarm of the part `label`; return whether that changed the state."""

    def clamped(self, reason: str) -> None:
        """Note that a processor has changed the behavior's setpoint in this tick."""


class Control:
    """Runs the processors and the tracker of a vehicle.

    followed: the setpoint that the tracker followed last, or None.
    clamps: the processors that keep the vehicle from its behavior's setpoint.
    set_option: requests the changes of options with which a processor retunes the tracker.
    Raises PartFailed if a part can't be constructed.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        params: dict[str, Any],
        set_option: OptionSetter,
        events: Events,
    ) -> None:
        self.followed: Setpoint | None = None
        self._plan, self._context, self._params = plan, context, params
        self._set_option, self._events = set_option, events
        self._parts = parts = {part.label: part for part in plan.processors}
        self._clamping = frozenset(label for label, part in parts.items() if part.cls.clamps)
        self.clamps = Clamps(
            plan.name,
            {label: part.name for label, part in parts.items()},
            {label: part.at for label, part in parts.items()},
            events,
        )
        self._tracker_label = plan.tracker.label
        self._raised = ""
        self.renew()

    def renew(self) -> None:
        """Construct new processors and a new tracker."""
        params, context = self._params, self._context
        processors: dict[str, Processor[Any]] = {
            part.label: make(part, params[part.label], context) for part in self._plan.processors
        }
        tracker: Tracker[Any] = make(self._plan.tracker, params[self._tracker_label], context)
        self._processors, self._tracker = processors, tracker
        self._active: tuple[tuple[str, _Process], ...] = ()

    def select(self, off: Set[str], *, in_air: bool) -> None:
        """Select the processors to run during the active behavior. in_air: the behavior stays in
        the air, so all run; otherwise only those for safety. Those whose labels are in `off` never
        run."""
        self._active = tuple(
            (label, processor.__call__)  # faster than calling the object
            for label, processor in self._processors.items()
            if (in_air or processor.safety) and label not in off and not processor.idle
        )

    def rest(self) -> None:
        """Forget the followed setpoint, because the tracker doesn't fly the vehicle now."""
        self.followed = None

    def follow(
        self, asked: Setpoint | Command, tick: Tick, reports: ProcessorReports, off_ground: bool
    ) -> Commanded | None:
        """Return the command for a behavior's output, or None if an alarm of a processor changed
        the state. Raises any exception of a part, and ValueError if a setpoint or command is not
        finite or a command would stop the rotors in the air."""
        if isinstance(asked, Command):
            self.followed = None
            return _turning(checked_command(asked), off_ground), None
        if asked.kind is _IDLE:
            command = _turning(RESTING, off_ground)
            self.followed = None
            return command, asked
        setpoint = checked_setpoint(asked)
        if setpoint.presses is not None:
            setpoint = setpoint._replace(acceleration=None)
        part = ""
        try:
            for part, process in self._active:
                output = process(setpoint, tick)
                if output is setpoint:
                    continue  # as nearly always
                if isinstance(output, Alarm):
                    processor, part = part, ""  # noqa: PLW2901 - what raises is not the processor
                    if reports.alarm(processor, output, tick):
                        return None
                else:
                    setpoint = self._changed(part, setpoint, output, tick.now, reports)
            if setpoint.presses is not None:
                setpoint = _pressing(asked, setpoint)
            part = self._tracker_label
            command = checked_command(self._tracker.update(setpoint, tick))
        except (Exception, SystemExit):
            self._raised = part
            raise
        self.followed = setpoint
        return (command if command.armed else _turning(command, off_ground)), asked

    def again(self, waiting: Command, tick: Tick) -> Command:
        """Return the command that waits for arming, recomputed by the tracker: the vehicle may
        already be rising and drift with the wind."""
        if self.followed is None or tick.estimate is None:
            return waiting
        self._raised = self._tracker_label
        command = checked_command(self._tracker.update(self.followed, tick))
        self._raised = ""
        return command

    def _changed(
        self,
        label: str,
        asked: Setpoint,
        output: Setpoint | Emitting | Retune,
        now: Time,
        reports: ProcessorReports,
    ) -> Setpoint:
        """Return the setpoint with which a processor answers `asked`, and note whether it clamps.
        Raises PartError for what it doesn't declare, ValueError if it is not finite."""
        given = self._granted(label, output) if isinstance(output, _MORE) else output
        given = checked_setpoint(given)
        if label in self._clamping:
            reason = self.clamps.note(label, asked, given, now)
            if reason is not None:
                reports.clamped(reason)
        return given

    def _granted(self, label: str, given: Emitting | Retune) -> Setpoint:
        """Emit a processor's event, or request its changes of the tracker's options, and return its
        setpoint. An event reports a refused change. Raises PartError for an event or option that
        the processor doesn't declare."""
        part, vehicle, output = self._parts[label], self._plan.name, given.output
        if isinstance(given, Emitting):
            event = given.event
            if type(event) not in part.cls.own_events or not isinstance(output, Setpoint):
                raise PartError(f"`{event.name}` with {output!r} is not among its declared events")
            self._events.emit(event.replaced(processor=part.name), vehicle, part.at)
            return output
        undeclared = given.options.keys() - part.cls.retunes
        if undeclared or not isinstance(output, Setpoint):
            named = ", ".join(f"`{option}`" for option in sorted(undeclared))
            raise PartError(f"{named or repr(output)} is not among its declared options")
        for option, value in given.options.items():
            name = f"{vehicle}.{self._tracker_label}.{option}"
            with suppress(OptionRefused):
                self._set_option(name, value, f"processor {part.name}", part.at)
        return output

    def attribute_failure(self, error: BaseException, behavior: str) -> tuple[PartFailed, bool]:
        """Return the failure of the part that raised `error`, and whether the vehicle needs that
        part to fly. behavior: the label to which the error is attributed if neither a processor nor
        the tracker raised it. A processor is not needed and is removed."""
        part, self._raised = self._raised or behavior, ""
        failure = error if isinstance(error, PartFailed) else PartFailed(part, error)
        self._active = tuple(active for active in self._active if active[0] != failure.part)
        return failure, self._processors.pop(failure.part, None) is None

    def hover_thrust(self) -> float:
        """Return the tracker's estimate of the hover thrust (N) if it is plausible, otherwise the
        airframe's weight."""
        weight = self._context.airframe.hover_thrust
        try:
            believed = self._tracker.hover_thrust
        except Exception:  # land_blind must be able to start without a tracker
            return weight
        return believed if _LEAST_HOVER <= believed / weight <= _MOST_HOVER else weight

    def lean(self) -> tuple[float, float]:
        """Return the tracker's `lean` if it is plausible, otherwise none."""
        try:
            x, y = self._tracker.lean
        except Exception:  # land_blind must be able to start without a tracker
            return (0.0, 0.0)
        return (x, y) if hypot(x, y) <= _MOST_LEAN else (0.0, 0.0)

    def parts(self) -> dict[str, Any]:
        """Return the processors and the tracker by label."""
        return {**self._processors, self._tracker_label: self._tracker}


def _pressing(asked: Setpoint, given: Setpoint) -> Setpoint:
    """Return the processors' setpoint with the acceleration with which the behavior presses: less
    of it if they hold the vehicle back by more than counts as a clamp."""
    held = dot(sub(asked.velocity or ZERO, given.velocity or ZERO), asked.presses or ZERO)
    share = min(1.0, max(0.0, 2.0 - held / _LEAST_SPEED))
    push = scale(asked.acceleration or ZERO, share)
    return given._replace(acceleration=add(given.acceleration or ZERO, push))


def _turning(command: Command, off_ground: bool) -> Command:
    """Return `command`. Raises ValueError if it would stop the rotors in the air."""
    if off_ground and not command.armed:
        raise ValueError("the rotors can't be off in the air")
    return command
