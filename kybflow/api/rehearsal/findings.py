"""The findings of a rehearsal as diagnostics: KYB470 to KYB484.

There is a function per code. `watch` decides that something is wrong; a function here describes it
at the mission line of the vehicle that causes it, with notes on the other vehicles involved.

`Arrivals` finds the values of a phase's `arrive` that would keep two of its vehicles apart, for the
hints. With `in_turns`, one vehicle flies its whole path before the other begins. With `together`,
both fly at a common pace, so that their relative motion is a straight line
(`kybflow.flight.motion.Pace`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.geometry import Vec3, least_distance, sub
from kybflow.core.params import named_in
from kybflow.core.signals import Event
from kybflow.core.units import DURATION, LENGTH, format_quantity
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Span, lines_of
from kybflow.dsl.plan import PhasePlan

if TYPE_CHECKING:
    from kybflow.runtime.engine import Engine
    from kybflow.runtime.vehicle.vehicle import Vehicle

_EMIT = "give a person's events at other times with `--emit NAME@TIME`"
_LONGER, _MORE_TIME = "takes longer", "allow more time, or check what it waits for"


class Doing(NamedTuple):
    """What a vehicle was doing when a problem was found.

    state: the name of its state. part: the name of the state's behavior. span: the mission line of
    the state. seconds: the time in the rehearsal. place: the vehicle's position, m. waits_for: what
    the behavior waits for, in words; may be empty.
    """

    vehicle: str
    state: str
    part: str
    span: Span
    seconds: float
    place: Vec3
    waits_for: str = ""

    @property
    def where(self) -> str:
        x, y, z = (f"{round(c, 2) + 0.0:.4g}" for c in self.place)
        return f"at [{x}, {y}, {z}] m"

    @property
    def when(self) -> str:
        return f"at {self.seconds:.1f} s, {self.where}"

    @property
    def label(self) -> str:
        return f"in `{self.state}`"

    @property
    def note(self) -> str:
        at = f" ({self.span.at})" if self.span.file else ""
        waits = f", waits for {self.waits_for}" if self.waits_for else ""
        return f"`{self.vehicle}` is in `{self.state}` ({self.part}) {self.where}{at}{waits}"


Texts = Mapping[str, str]
"""The contents of the mission's files, by file name."""


def span_at(at: str, texts: Texts) -> Span:
    """Return the span of the mission line `at`, given as `file:line`, without surrounding
    blanks."""
    file, _, number = at.rpartition(":")
    line = int(number) if number.isdigit() else 1
    lines = lines_of(texts.get(file, ""))
    text = lines[line - 1].rstrip() if line <= len(lines) else ""
    start = len(text) - len(text.lstrip())
    return Span(file or at, line, start + 1, line, max(len(text), start + 1) + 1)


class Arrival(NamedTuple):
    """How a `phase` that brings two vehicles too close could keep them apart.

    ways: values of `arrive` that would do so. order: how to reorder the vehicles, in words; empty
    if their order can stay.
    """

    phase: str
    ways: tuple[str, ...]
    order: str = ""

    @property
    def hint(self) -> str:
        said = " or ".join(f"`arrive: {way}`" for way in self.ways)
        return f"let the phase `{self.phase}` say {said} {self.order}".rstrip()


def _warning_if(condition: bool) -> Severity:
    return Severity.WARNING if condition else Severity.ERROR


def collided(own: Doing, other: Doing, arrival: Arrival | None = None) -> Diagnostic:
    """KYB470: two vehicles collide: their distance is less than the sum of their arms."""
    said = f"`{own.vehicle}` and `{other.vehicle}` collide {own.when}"
    way = arrival.hint if arrival else "let one of them wait for the other"
    hint = f"{way}, or keep their paths apart"
    return Diagnostic("KYB470", said, own.span, own.label, (other.note,), hint)


def ran_into(own: Doing, into: str) -> Diagnostic:
    """KYB471: a vehicle runs into an obstacle, or into the floor without landing."""
    said = f"`{own.vehicle}` runs into `{into}` {own.when}"
    return Diagnostic("KYB471", said, own.span, own.label, help="lead it around")


def landed_hard(own: Doing, speed: float) -> Diagnostic:
    """KYB472: a vehicle touches down too fast."""
    said = f"`{own.vehicle}` touches down with {speed:.2f} m/s {own.when}"
    return Diagnostic("KYB472", said, own.span, own.label, help="descend more slowly")


def left_the_fence(own: Doing, why: str, by: str, *, is_vertical: bool) -> Diagnostic:
    """KYB473: a behavior leads a vehicle out of the fence, or to a place that a processor keeps
    setpoints from. For a take-off or a landing, which continues as far as the bound allows, it is a
    warning."""
    said = f"`{own.state}` ({own.part}) leads `{own.vehicle}` out of bounds {own.when}"
    notes = (f"the bound: {by}",) if by else ()
    hint = "keep its path inside the fence and clear of obstacles"
    return Diagnostic("KYB473", said, own.span, why, notes, hint, _warning_if(is_vertical))


def failsafe_acted(
    own: Doing, reaction: str, why: str, by: str, others: tuple[str, ...], arrival: Arrival | None
) -> Diagnostic:
    """KYB474: the failsafe takes over although nothing is broken: the mission itself crosses a
    bound of a supervisor."""
    said = f"the failsafe reacts to `{own.state}` of `{own.vehicle}` with `{reaction}` {own.when}"
    notes = (*others, *((f"the bound: {by}",) if by else ()))
    way = "keep their paths apart, in height or in time" if others else "stay within the bound"
    hint = f"{arrival.hint if arrival else way}, or move the bound"
    return Diagnostic("KYB474", said, own.span, why, notes, hint)


def failed(own: Doing, why: str) -> Diagnostic:
    """KYB475: a behavior fails or refuses to start although nothing is broken, or a flow or a
    callback requests a state that the vehicle can't enter at that time."""
    said = f"`{own.state}` ({own.part}) of `{own.vehicle}` fails {own.when}"
    return Diagnostic("KYB475", said, own.span, why)


def refused(own: Doing, wanted: str, why: str, at: str, texts: Texts) -> Diagnostic:
    """KYB475: a vehicle refuses to enter a state."""
    said, span = f"`{own.vehicle}` refuses to enter `{wanted}` {own.when}", span_at(at, texts)
    return Diagnostic("KYB475", said, span, why, (own.note,))


def timed_out(own: Doing, limit: float | None) -> Diagnostic:
    """KYB476: a `within` of a behavior or of a phase runs out although nothing is broken."""
    after = "" if limit is None else f" of {format_quantity(limit, DURATION)}"
    said = f"`{own.state}` of `{own.vehicle}` is not done within its limit{after}, {own.when}"
    return Diagnostic("KYB476", said, own.span, _LONGER, help=_MORE_TIME)


def phase_timed_out(
    flow: str, phase: PhasePlan, seconds: float, notes: tuple[str, ...], texts: Texts
) -> Diagnostic:
    """KYB476: a phase's `within` runs out."""
    limit = next((t.after for t in phase.transitions if t.cause == "within"), None)
    after = "" if limit is None else f" of {format_quantity(limit, DURATION)}"
    said = f"the phase `{phase.name}` of `{flow}` is not over within its time{after}"
    said, span = f"{said}, at {seconds:.1f} s", span_at(phase.at, texts)
    return Diagnostic("KYB476", said, span, _LONGER, notes, _MORE_TIME)


class Waiting(NamedTuple):
    """A flow in a phase, or a vehicle in a state, that keeps the mission from ending.

    phase: the name of the phase or state. at: its mission line. waits_for: what it waits for, in
    words.
    """

    name: str
    phase: str
    at: str
    waits_for: str


def not_finished(
    waiting: Waiting, limit: float, notes: tuple[str, ...], texts: Texts
) -> Diagnostic:
    """KYB477: the mission isn't over at its time limit: a flow or a vehicle waits for something
    that doesn't come."""
    said = f"the mission is not over after {format_quantity(limit, DURATION)}: "
    said += f"`{waiting.name}` is still in `{waiting.phase}`"
    label, span = f"waits for {waiting.waits_for}", span_at(waiting.at, texts)
    return Diagnostic("KYB477", said, span, label, notes, _EMIT)


def battery_ended(own: Doing) -> Diagnostic:
    """KYB478: a battery is empty before the mission is over."""
    said = f"the battery of `{own.vehicle}` is empty {own.when}"
    hint = "make the mission shorter, or give the airframe more `endurance`"
    return Diagnostic("KYB478", said, own.span, own.label, help=hint)


def common_place(own: Doing, other: Doing, *, rests: bool) -> Diagnostic:
    """KYB479: two vehicles come down in one place. It is a warning if one waits for the other or
    turns aside, an error if they rest on each other."""
    verb = "comes to rest" if rests else "comes down"
    said = f"`{own.vehicle}` {verb} where `{other.vehicle}` is, {own.when}"
    hint, severity = "land them in different places", _warning_if(not rests)
    return Diagnostic("KYB479", said, own.span, own.label, (other.note,), hint, severity)


def too_close(
    own: Doing, other: Doing, gap: float, needed: float, arrival: Arrival | None
) -> Diagnostic:
    """KYB480: two vehicles fly so close to each other that the discs of their rotors can overlap,
    depending on the headings."""
    near = format_quantity(round(gap, 2), LENGTH)
    said = f"`{own.vehicle}` and `{other.vehicle}` come within {near} of each other {own.when}"
    label = f"their rotors need {format_quantity(round(needed, 2), LENGTH)}"
    hint = f"{arrival.hint}, or keep their paths apart" if arrival else "keep their paths apart"
    return Diagnostic("KYB480", said, own.span, label, (other.note,), hint, Severity.WARNING)


def left_hovering(own: Doing, limit: float, ended: tuple[Related, ...]) -> Diagnostic:
    """KYB484: after its last state a vehicle hovers until the failsafe lands it, because no
    transition, flow or callback does (a warning)."""
    said = f"nothing lands `{own.vehicle}` after `{own.state}`"
    label = f"it hovers for {format_quantity(limit, DURATION)}, then the failsafe lands it"
    hint = "let a transition or a phase land it"
    severity = Severity.WARNING
    return Diagnostic("KYB484", said, own.span, label, help=hint, severity=severity, related=ended)


def stays_down(vehicle: str, check: str, why: str, at: str, texts: Texts) -> Diagnostic:
    """KYB481: the preflight of the rehearsal stays red although nothing is broken: the vehicle
    would not take off."""
    said = f"`{vehicle}` would not take off: its preflight check `{check}` stays red"
    return Diagnostic("KYB481", said, span_at(at, texts), why)


def unmet(expectation: str, at: str, value: str, texts: Texts) -> Diagnostic:
    """KYB482: an expectation does not hold although nothing is broken and everything else is in
    order. It is reported only for missions in which no person acts, and not if a fault of the
    mission may explain it: it failed after the first fault began, and that fault can change it."""
    said = f"`{expectation}` does not hold on ideal vehicles"
    label = f"it is {value}" if value else "not met"
    hint = "change the expectation or the mission"
    return Diagnostic("KYB482", said, span_at(at, texts), label, help=hint)


def comes_too_late(fault: str, vehicle: str, ended: float, at: str, texts: Texts) -> Diagnostic:
    """KYB483: a fault begins long after its vehicle has landed for good, so it tests nothing (a
    warning)."""
    said = f"`{fault}` begins after the flight of `{vehicle}`"
    label = f"`{vehicle}` has landed at {ended:.1f} s"
    hint, severity = "inject it earlier", Severity.WARNING
    return Diagnostic("KYB483", said, span_at(at, texts), label, help=hint, severity=severity)


def never_comes(fault: str, condition: str, at: str, texts: Texts) -> Diagnostic:
    """KYB483: the condition of a fault never holds in the rehearsal."""
    said, span = f"`{fault}` is never injected", span_at(at, texts)
    label, hint = f"`{condition}` never holds", "correct its condition, or remove the fault"
    return Diagnostic("KYB483", said, span, label, help=hint, severity=Severity.WARNING)


class StraightWay(NamedTuple):
    """A vehicle's path in a phase, from `begin` straight to `end` (world, metres). end: None if the
    path is not straight or not known. keeps_pace: whether the behavior can fly at a slower pace."""

    vehicle: str
    begin: Vec3
    end: Vec3 | None
    keeps_pace: bool


class Arrivals:
    """Finds values of `arrive` for an engine's phases, given where the behaviors began."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._vehicles = {vehicle.name: vehicle for vehicle in engine.vehicles}
        self._began: dict[tuple[str, str], Vec3] = {}

    def started(self, event: Event) -> None:
        """Store the position (world, metres) at which a behavior begins. Called for each
        `behavior_started`."""
        truth = self._vehicles[event.vehicle].truth
        if truth is not None:
            self._began[event.vehicle, str(event.fields["behavior"])] = truth.position

    def apart(self, one: Vehicle, other: Vehicle, needed: float) -> Arrival | None:
        """Return how the phase that flies both vehicles could keep them `needed` metres apart. None
        if no phase flies them, if the phase does so already, or if one of them flies with its
        group, whose members arrive together."""
        for flow in self._engine.plan.flows:
            running = self._engine.flows.running(flow.name)
            if not running.active or not {one.name, other.name} <= running.phase.run.keys():
                continue
            if not any(running.is_in_its_state(v.name, v.state) for v in (one, other)):
                continue
            phase = running.phase
            for vehicle in (one, other):
                behavior = vehicle.plan.states[phase.run[vehicle.name].state].behavior
                if named_in(behavior.params, "group"):
                    return None
            return arrival(phase, self._way(one, phase), self._way(other, phase), needed)
        return None

    def _way(self, vehicle: Vehicle, phase: PhasePlan) -> StraightWay:
        name = vehicle.name
        request = phase.run[name]
        cls = vehicle.plan.states[request.state].behavior.cls
        begin = self._began.get((name, request.state))
        params = vehicle.runner.params_of(request.state, request.values)
        flown = cls.footprint(params, begin)
        end = None
        if flown is not None and len(flown.points) == 2 and not flown.path:
            end = flown.exit
        return StraightWay(name, begin or vehicle.context.start, end, cls.keeps_pace)


def arrival(
    phase: PhasePlan, one: StraightWay, other: StraightWay, needed: float
) -> Arrival | None:
    """Return how the phase could keep two of its vehicles `needed` metres apart. None if it can't,
    or if they arrive in turns already."""
    if phase.arrive == "in_turns":
        return None
    if one.end is None or other.end is None:
        return Arrival(phase.name, ("in_turns",))
    order = list(phase.run)
    first, second = sorted((one, other), key=lambda way: order.index(way.vehicle))
    ways, before = [], ""
    if _in_turns(first, second) >= needed:
        ways.append("in_turns")
    elif _in_turns(second, first) >= needed:
        ways.append("in_turns")
        before = f"with `{second.vehicle}` before `{first.vehicle}`"
    paced = one.keeps_pace and other.keeps_pace and phase.arrive is None
    if paced and least_distance(sub(one.begin, other.begin), sub(one.end, other.end)) >= needed:
        ways.insert(0, "together")
    return Arrival(phase.name, tuple(ways), before) if ways else None


def _in_turns(first: StraightWay, second: StraightWay) -> float:
    """Return the least distance between two vehicles, metres, if `second` starts only after `first`
    has arrived."""
    assert first.end is not None
    assert second.end is not None
    ahead = least_distance(sub(first.begin, second.begin), sub(first.end, second.begin))
    behind = least_distance(sub(second.begin, first.end), sub(second.end, first.end))
    return min(ahead, behind)
