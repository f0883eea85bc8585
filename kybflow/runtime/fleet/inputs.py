"""The mission's input devices, which are read and checked once a tick; changes become events.

    device ─► link ─► checks ─► readings for behaviors and conditions
                           └──► events: INPUT.BUTTON, input_lost, input_recovered

An input is lost while its link reports a problem (such as an unplugged device), while it has been
silent for longer than `silent_after`, while an axis is not a number from -1 to 1, and while the
axes are off their centres and have not changed for `stuck_after`. A lost input has no reading. It
has recovered once it has been free of problems for half a second. A button emits its event when it
is pressed, even while an axis is broken, since it may be the button that lands. A button that was
held during a silence doesn't count as pressed again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.errors import DriverError, described
from kybflow.core.events import Custom
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, InputReading, InputReadings, Time
from kybflow.dsl.plan import InputPlan
from kybflow.flight.formation.places import centroid
from kybflow.parts import InputLink
from kybflow.parts.events import InputLost, InputRecovered
from kybflow.parts.input import FeltLink
from kybflow.runtime.events import Events

if TYPE_CHECKING:
    from kybflow.runtime.vehicle.vehicle import Vehicle

RECOVERY_TIME_NS: Time = NS // 2
"""How long a lost input must be free of problems before it is used again."""
_NOTHING: frozenset[str] = frozenset()
_SILENT = (None, _NOTHING)

NoteInput = Callable[[str, Time, InputReading | None, str], None]
"""Receives an input's name, the time, its reading, and an empty string; or, if there is no reading,
None and the reason."""


def unnoted(name: str, now: Time, reading: InputReading | None, why: str) -> None:
    """Ignore the reading, because nothing is recorded."""


class InputTrouble(NamedTuple):
    """Why an input is lost. value, bound: the measured value and its bound, each None if there is
    no such number."""

    reason: str
    value: float | None = None
    bound: float | None = None


class Inputs:
    """The input devices of a mission. readings: the reading of each input, by name; None while the
    input is lost. The mapping itself is given to the vehicles, whose behaviors find it in
    `Tick.inputs`, and to conditions."""

    def __init__(
        self,
        plans: tuple[InputPlan, ...],
        links: Mapping[str, InputLink],
        events: Events,
        note: NoteInput = unnoted,
    ) -> None:
        self._heard: dict[str, InputReading | None] = dict.fromkeys(plan.name for plan in plans)
        self.readings: InputReadings = MappingProxyType(self._heard)
        self._inputs = tuple(_Input(plan, links[plan.name], events, note) for plan in plans)
        opened = ((one, links[one.plan.name]) for one in self._inputs)
        self._felt = [(one, link) for one, link in opened if isinstance(link, FeltLink)]

    def __len__(self) -> int:
        return len(self._inputs)

    def step(self, now: Time, vehicles: Iterable[Vehicle] = (), *, flying: bool = True) -> None:
        """Read every input, emit its events in flight, and apply to each hand the force that the
        vehicles requested in the last tick. Called at the start of a tick."""
        for one in self._inputs:
            self._heard[one.plan.name] = one.step(now, flying)
        if self._felt:
            steered = [push for vehicle in vehicles for push in vehicle.pushes()]
            for one, link in self._felt:
                one.apply_force(
                    link, _felt([push for name, push in steered if name == one.plan.name])
                )

    def end(self, now: Time, why: str) -> None:
        """Record the end of all inputs, so that the last deflection doesn't continue when the
        recording is replayed to steer another flight. now: a time after the last step."""
        for one in self._inputs:
            one.end(now, why)

    def objections(self) -> Iterator[tuple[InputPlan, str | None]]:
        """Yield each input and why it can't be used now, or None if it can."""
        for one in self._inputs:
            yield one.plan, one.trouble and one.trouble.reason


def _felt(pushes: list[Vec3 | None]) -> Vec3 | None:
    """Return the force on a hand: the mean over the steered vehicles that are not held, None if all
    are held. pushes: the force of each steered vehicle, None if it is held."""
    if not pushes:
        return ZERO
    free = tuple(push for push in pushes if push is not None)
    return centroid(free) if free else None


class _Input:
    """Reads and checks one input. trouble: why it can't be used, or None."""

    def __init__(self, plan: InputPlan, link: InputLink, events: Events, note: NoteInput) -> None:
        self.plan = plan
        self.trouble: InputTrouble | None = InputTrouble("it has not sent anything yet")
        self._link, self._events, self._note = link, events, note
        self._noted: tuple[Mapping[str, float] | None, frozenset[str]] | None = None
        self._held = _NOTHING
        self._axes: Mapping[str, float] | None = None
        self._moved: Time = 0
        self._well: Time | None = None
        self._reported = False
        self._began: Time | None = None
        self._unfelt: InputTrouble | None = None

    def step(self, now: Time, flying: bool) -> InputReading | None:
        self._began = now if self._began is None else self._began
        reading, silence = self._read(now)
        new = _SILENT if reading is None else (reading.axes, reading.held)
        if new != self._noted and (reading is not None or silence is not None):
            self._note(self.plan.name, now, reading, "" if silence is None else silence.reason)
            self._noted = new
        trouble = silence or self._unfelt or self._doubt(reading, now)
        self._unfelt = None
        if reading is not None:
            for button in sorted(reading.held - self._held) if flying else ():
                self._events.emit(Custom(f"{self.plan.name}.{button}"), at=self.plan.at)
            self._held = reading.held
        if trouble is not None:
            self._well = None
            self.trouble = (self._reported and self.trouble) or trouble
        else:
            self._well = now if self._well is None else self._well
            if not self._reported or now - self._well >= RECOVERY_TIME_NS:
                self.trouble = None
        if flying and (self.trouble is not None) != self._reported:
            self._report()
        return reading if self.trouble is None else None

    def apply_force(self, link: FeltLink, push: Vec3 | None) -> None:
        try:
            link.apply_force(push if self.trouble is None else None)
        except Exception as error:  # an input must not stop the flight
            self._unfelt = InputTrouble(described(error))

    def end(self, now: Time, why: str) -> None:
        if self._noted not in (None, _SILENT):
            self._note(self.plan.name, now, None, why)

    def _read(self, now: Time) -> tuple[InputReading | None, InputTrouble | None]:
        """Return the reading, with its buttons named as in the mission, and None; or None and the
        reason if there is a problem."""
        try:
            reading, known = self._link.read(now), self._link.trouble()
        except DriverError as error:
            return None, InputTrouble(str(error))
        except Exception as error:  # an input must not stop the flight
            return None, InputTrouble(described(error))
        if known is not None:
            return None, InputTrouble(known)
        heard = self._began if reading is None else reading.heard
        age, bound = (now - (heard or 0)) / NS, self.plan.silent_after
        if age > bound:
            return None, InputTrouble(f"silent for {age:.2f} s", age, bound)
        if reading is None:
            return None, None
        names, dead_man = self.plan.button_names, self.plan.dead_man
        held = frozenset(names[button] for button in reading.held if button in names)
        return reading._replace(held=held, engaged=dead_man is None or dead_man in held), None

    def _doubt(self, reading: InputReading | None, now: Time) -> InputTrouble | None:
        """Return why the reading is missing or implausible, or None if it is good."""
        if reading is None:
            return self.trouble or InputTrouble("it has not sent anything yet")
        for axis, value in reading.axes.items():
            if not (isfinite(value) and abs(value) <= 1.0):
                return InputTrouble(f"its axis `{axis}` is {value:g}", value)
        if reading.axes != self._axes:
            self._axes, self._moved = reading.axes, now
        still, bound = (now - self._moved) / NS, self.plan.stuck_after
        if bound is not None and still > bound and not reading.is_centred(reading.axes):
            return InputTrouble(f"its axes are stuck for {still:.2f} s", still, bound)
        return None

    def _report(self) -> None:
        """Emit an event because the input is lost, or because it has recovered."""
        name, at = self.plan.name, self.plan.at
        self._reported = self.trouble is not None
        if self.trouble is not None:
            reason, *numbers = self.trouble
            value, bound = (n if n is not None and isfinite(n) else None for n in numbers)
            self._events.emit(InputLost(input=name, reason=reason, value=value, bound=bound), at=at)
        else:
            self._events.emit(InputRecovered(input=name), at=at)
