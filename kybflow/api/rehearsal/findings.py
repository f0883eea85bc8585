"""The findings of a rehearsal as diagnostics: KYB470 to KYB482.

There is a function per code. `watch` decides that something is wrong; a function here describes it
at the mission line of the vehicle that causes it, with notes on the other vehicles involved.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.core.units import DURATION, LENGTH, format_quantity
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span

_EMIT = "give a person's events at other times with `--emit NAME@TIME`"


class Doing(NamedTuple):
    """What a vehicle was doing when a problem was found.

    state, part: its behavior and the behavior's part. span: the mission line of the state. seconds:
    the time in the rehearsal. place: its position, m. waits_for: what it waits for, in words; may
    be empty.
    """

    vehicle: str
    state: str
    part: str
    span: Span
    seconds: float
    place: Vec3
    waits_for: str = ""

    @property
    def when(self) -> str:
        x, y, z = (f"{round(c, 2) + 0.0:.4g}" for c in self.place)
        return f"at {self.seconds:.1f} s, at [{x}, {y}, {z}] m"

    @property
    def note(self) -> str:
        where = f" ({self.span.at})" if self.span.file else ""
        x, y, z = (f"{round(c, 2) + 0.0:.4g}" for c in self.place)
        waits = f", waits for {self.waits_for}" if self.waits_for else ""
        who = f"`{self.vehicle}` is in `{self.state}` ({self.part})"
        return f"{who} at [{x}, {y}, {z}] m{where}{waits}"


Texts = Mapping[str, str]
"""The contents of the mission's files, by file name."""


def span_at(at: str, texts: Texts) -> Span:
    """Return the span of the mission line `at`, given as `file:line`, without surrounding
    blanks."""
    file, _, number = at.rpartition(":")
    line = int(number) if number.isdigit() else 1
    lines = texts.get(file, "").split("\n")
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


def collided(own: Doing, other: Doing, arrival: Arrival | None = None) -> Diagnostic:
    """KYB470: two vehicles are nearer to each other than an arm of each: they collide."""
    return Diagnostic(
        "KYB470",
        f"`{own.vehicle}` and `{other.vehicle}` collide {own.when}",
        own.span,
        label=f"in `{own.state}`",
        notes=(other.note,),
        help=f"{arrival.hint if arrival else 'let one of them wait for the other'}, "
        "or keep their ways apart",
    )


def ran_into(own: Doing, into: str) -> Diagnostic:
    """KYB471: a vehicle runs into an obstacle, or into the floor without landing."""
    return Diagnostic(
        "KYB471",
        f"`{own.vehicle}` runs into `{into}` {own.when}",
        own.span,
        label=f"in `{own.state}`",
        help="lead it around",
    )


def landed_hard(own: Doing, speed: float) -> Diagnostic:
    """KYB472: a vehicle touches down too fast."""
    return Diagnostic(
        "KYB472",
        f"`{own.vehicle}` touches down with {speed:.2f} m/s {own.when}",
        own.span,
        label=f"in `{own.state}`",
        help="descend more slowly",
    )


def left_the_fence(own: Doing, why: str, by: str, *, is_vertical: bool) -> Diagnostic:
    """KYB473: a behavior leads a vehicle out of the fence, or to where a processor lets no setpoint
    go. It is a warning of a take-off or a landing, which goes on where it is let."""
    return Diagnostic(
        "KYB473",
        f"`{own.state}` ({own.part}) leads `{own.vehicle}` out of bounds {own.when}",
        own.span,
        label=why,
        notes=(f"the bound: {by}",) if by else (),
        help="keep its way inside the fence and clear of obstacles",
        severity=Severity.WARNING if is_vertical else Severity.ERROR,
    )


def failsafe_acted(
    own: Doing,
    reaction: str,
    why: str,
    by: str,
    others: tuple[str, ...],
    arrival: Arrival | None = None,
) -> Diagnostic:
    """KYB474: the failsafe takes over although nothing is broken: what the mission does crosses a
    bound of a supervisor. others: what the vehicles do that the reason names."""
    alone = "keep their ways apart, in height or in time" if others else "stay within the bound"
    return Diagnostic(
        "KYB474",
        f"the failsafe answers `{own.state}` of `{own.vehicle}` with `{reaction}` {own.when}",
        own.span,
        label=why,
        notes=(*others, *((f"the bound: {by}",) if by else ())),
        help=f"{arrival.hint if arrival else alone}, or move the bound",
    )


def failed(own: Doing, why: str, *, answered: bool) -> Diagnostic:
    """KYB475: a behavior fails or refuses to start although nothing is broken. It is a warning
    where the mission says what follows, and where a flow or a callback asks for a state that the
    vehicle can't enter then: it stays in the one that it is in."""
    return Diagnostic(
        "KYB475",
        f"`{own.state}` ({own.part}) of `{own.vehicle}` fails {own.when}",
        own.span,
        label=why,
        severity=Severity.WARNING if answered else Severity.ERROR,
    )


def refused(own: Doing, wanted: str, why: str, at: str, texts: Texts) -> Diagnostic:
    """KYB475: a vehicle refuses to enter a state."""
    return Diagnostic(
        "KYB475",
        f"`{own.vehicle}` refuses to enter `{wanted}` {own.when}",
        span_at(at, texts),
        label=why,
        notes=(own.note,),
        severity=Severity.WARNING,
    )


def timed_out(own: Doing, limit: float | None, *, answered: bool) -> Diagnostic:
    """KYB476: a `within` of a behavior or of a phase runs out although nothing is broken. It is a
    warning where the mission says what follows."""
    after = "" if limit is None else f" of {format_quantity(limit, DURATION)}"
    who = f"`{own.state}` of `{own.vehicle}`"
    return Diagnostic(
        "KYB476",
        f"{who} is not done within its time{after}, {own.when}",
        own.span,
        label="takes longer",
        help="give it more time, or see what it waits for",
        severity=Severity.WARNING if answered else Severity.ERROR,
    )


def phase_timed_out(
    flow: str,
    phase: str,
    at: str,
    limit: float | None,
    seconds: float,
    notes: tuple[str, ...],
    texts: Texts,
) -> Diagnostic:
    """KYB476: a phase's `within` runs out."""
    after = "" if limit is None else f" of {format_quantity(limit, DURATION)}"
    return Diagnostic(
        "KYB476",
        f"the phase `{phase}` of `{flow}` is not over within its time{after}, at {seconds:.1f} s",
        span_at(at, texts),
        label="takes longer",
        notes=notes,
        help="give it more time, or see what it waits for",
        severity=Severity.WARNING,
    )


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
    """KYB477: the mission isn't over at its time limit: a flow or a vehicle waits for what doesn't
    come."""
    return Diagnostic(
        "KYB477",
        f"the mission is not over after {format_quantity(limit, DURATION)}: "
        f"`{waiting.name}` is still in `{waiting.phase}`",
        span_at(waiting.at, texts),
        label=f"waits for {waiting.waits_for}",
        notes=notes,
        help=_EMIT,
    )


def battery_ended(own: Doing) -> Diagnostic:
    """KYB478: a battery is empty before the mission is over."""
    return Diagnostic(
        "KYB478",
        f"the battery of `{own.vehicle}` is empty {own.when}",
        own.span,
        label=f"in `{own.state}`",
        help="make the mission shorter, or give the airframe more `endurance`",
    )


def common_place(own: Doing, other: Doing, *, rests: bool) -> Diagnostic:
    """KYB479: two vehicles come down in one place. It is a warning where one waits for the other or
    turns aside, an error where they rest on each other."""
    verb = "comes to rest" if rests else "comes down"
    return Diagnostic(
        "KYB479",
        f"`{own.vehicle}` {verb} where `{other.vehicle}` is, {own.when}",
        own.span,
        label=f"in `{own.state}`",
        notes=(other.note,),
        help="land them in places of their own",
        severity=Severity.ERROR if rests else Severity.WARNING,
    )


def too_close(
    own: Doing,
    other: Doing,
    gap: float,
    needed: float,
    arrival: Arrival | None = None,
) -> Diagnostic:
    """KYB480: two vehicles fly so close to each other that the discs of their rotors meet, unless
    they are turned well."""
    near = format_quantity(round(gap, 2), LENGTH)
    return Diagnostic(
        "KYB480",
        f"`{own.vehicle}` and `{other.vehicle}` come within {near} of each other {own.when}",
        own.span,
        label=f"their rotors need {format_quantity(round(needed, 2), LENGTH)}",
        notes=(other.note,),
        help=f"{arrival.hint}, or keep their ways apart" if arrival else "keep their ways apart",
        severity=Severity.WARNING,
    )


def stays_down(vehicle: str, check: str, why: str, at: str, texts: Texts) -> Diagnostic:
    """KYB481: the preflight of the rehearsal stays red although nothing is broken: the vehicle
    would not take off."""
    return Diagnostic(
        "KYB481",
        f"`{vehicle}` would not take off: its preflight check `{check}` stays red",
        span_at(at, texts),
        label=why,
    )


def unmet(expectation: str, at: str, value: str, texts: Texts) -> Diagnostic:
    """KYB482: an expectation does not hold although nothing is broken and everything else is in
    order. It is told of missions without faults in which no person acts. value: what was measured,
    empty where that is no number."""
    return Diagnostic(
        "KYB482",
        f"`{expectation}` does not hold on ideal vehicles",
        span_at(at, texts),
        label=f"it is {value}" if value else "not met",
        help="expect something else, or let the mission do it",
        severity=Severity.WARNING,
    )
