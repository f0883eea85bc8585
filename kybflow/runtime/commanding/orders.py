"""The commands that a person can give to a run. Each is a frozen value with one spelling:

    emit operator.go                         switch mk hold [PARAMETER=VALUE ...]
    set mk.processors.limit_speed.speed 50cm/s
    enable mk.processors.limit_speed         disable mk.processors.limit_speed
    phase swarm gather                       perform mk leds_blink_red
    pause [VEHICLE ...]
    resume [VEHICLE ...]                     reset [VEHICLE ...]
    land [VEHICLE ...]                       stop [REASON]
    release
    track mk time=12.5 position=[1, 0, 1.2] [velocity=... acceleration=... heading=...]

The command line, the socket and the recording of a run use this spelling. The commands that
callbacks can give too are values of `kybflow.dsl.plan`. The names in a command are checked when it
is executed.

The lease is the right to command a run. The first person who gives a command holds the lease until
they release it or another person takes it. `land`, `pause` and `stop` need no lease, nor do the
run's scheduled commands.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from kybflow.core.errors import CommandUnreadable, UnitError
from kybflow.core.signals import PlannedPoint
from kybflow.core.text import did_you_mean
from kybflow.core.units import parse_number
from kybflow.dsl.plan import Emit, Enable, EnterPhase, Perform, SetOption, Stop, Switch

PREFIX = "operator."
MOST_LETTERS = 1000
"""Largest number of characters of a command."""


@dataclass(frozen=True)
class VehicleOrder:
    """A command to the named vehicles, or to all if none is named."""

    vehicles: tuple[str, ...] = ()


class PauseOrder(VehicleOrder):
    """Hold the vehicles, with their behaviors frozen."""


class ResumeOrder(VehicleOrder):
    """Resume the vehicles after a pause; request control back from a pilot."""


class ResetOrder(VehicleOrder):
    """Take the vehicles that are on the ground out of `fault`."""


class LandOrder(VehicleOrder):
    """Land the vehicles. They stay on the ground for the rest of the run."""


@dataclass(frozen=True, slots=True)
class ReleaseLease:
    """Give up the lease, so that the next person doesn't have to take it."""


@dataclass(frozen=True, slots=True)
class TrackOrder:
    """Give a vehicle's behavior a point of a planned trajectory. All numbers are in SI units."""

    vehicle: str
    point: PlannedPoint


Order = (
    Emit | Switch | SetOption | Enable | EnterPhase | Perform | VehicleOrder | Stop | ReleaseLease
    | TrackOrder
)  # fmt: skip


class Answer(NamedTuple):
    """The answer to a command. reason: why it was refused, as in the event that reports it. For an
    accepted command: which vehicles refused it, or why it has no effect now; otherwise empty."""

    accepted: bool
    reason: str = ""


OF_VEHICLES: Mapping[str, type[VehicleOrder]] = {
    "pause": PauseOrder,
    "resume": ResumeOrder,
    "reset": ResetOrder,
    "land": LandOrder,
}
"""The commands to some or all vehicles, by their first word."""
_WORD = {kind: word for word, kind in OF_VEHICLES.items()}
COMMANDS = (*(f"{PREFIX}{word}" for word in OF_VEHICLES), f"{PREFIX}stop")
"""The operator's events that take effect even if the mission doesn't wait for them."""


def named(name: str) -> Order:
    """Return the command for the event `name`: for an event of COMMANDS the command to all
    vehicles, otherwise `emit`."""
    if name == f"{PREFIX}stop":
        return Stop("")
    kind = OF_VEHICLES.get(name.removeprefix(PREFIX)) if name.startswith(PREFIX) else None
    return Emit(name) if kind is None else kind()


def word(order: VehicleOrder) -> str:
    """Return the first word of a command to vehicles."""
    return _WORD[type(order)]


def text(order: Order) -> str:
    """Return the spelling of a command, on one line; the inverse of `parse`."""
    match order:
        case Emit(name):
            words = ["emit", name]
        case Switch(vehicle, state, values):
            words = ["switch", vehicle, state, *(f"{name}={value}" for name, value in values)]
        case SetOption(option, value):
            words = ["set", option, str(value)]
        case Enable(vehicle, label, on):
            words = ["enable" if on else "disable", f"{vehicle}.{label}"]
        case EnterPhase(flow, phase):
            words = ["phase", flow, phase]
        case Perform(vehicle, act):
            words = ["perform", vehicle, act]
        case Stop(reason):
            words = ["stop", reason]
        case ReleaseLease():
            words = ["release"]
        case TrackOrder(vehicle, point):
            words = ["track", vehicle, *_written(point)]
        case _:
            words = [word(order), *order.vehicles]
    return " ".join(" ".join(words).split())


def parse(words: str) -> Order:
    """Return the command that `words` spell. Raises CommandUnreadable with what is wrong or how the
    command is written."""
    if len(words) > MOST_LETTERS:
        raise CommandUnreadable(f"a command has at most {MOST_LETTERS} letters, not {len(words)}")
    command, *rest = unicodedata.normalize("NFC", words).split() or [""]
    form = _FORMS.get(command)
    if form is None:
        hint = did_you_mean(command, _FORMS)
        raise CommandUnreadable(f"there is no command `{command[:40]}`; {hint}")
    order = form.read(rest)
    if order is None:
        raise CommandUnreadable(f"`{command}` is written `{command}{form.arguments}`")
    return order


@dataclass(frozen=True, slots=True)
class _Form:
    """The form of a command. arguments: a description of its arguments. read: parses them, or
    returns None if they don't fit."""

    arguments: str
    read: Callable[[list[str]], Order | None]


def _of_vehicles(kind: type[VehicleOrder]) -> _Form:
    return _Form(" [VEHICLE ...]", lambda rest: kind(tuple(dict.fromkeys(rest))))


def _enable(on: bool) -> _Form:
    def read(rest: list[str]) -> Order | None:
        vehicle, _, label = rest[0].partition(".") if len(rest) == 1 else ("", "", "")
        return Enable(vehicle, label, on) if label else None

    return _Form(" VEHICLE.processors.NAME", read)


def _switch(rest: list[str]) -> Switch | None:
    """Parse a `switch` command. Values may contain spaces: `position=[1, 0, 1] speed=50 cm/s`."""
    before, *pairs = _ASSIGNED.split(" ".join(rest[2:]))
    names, written = pairs[::2], [value.strip() for value in pairs[1::2]]
    if len(rest) < 2 or before or len(set(names)) < len(names) or not all(written):
        return None
    return Switch(rest[0], rest[1], tuple(zip(names, written, strict=True)))


def _track(rest: list[str]) -> TrackOrder | None:
    """Parse a `track` command. The behavior that takes the point checks its numbers."""
    before, *pairs = _ASSIGNED.split(" ".join(rest[1:]))
    names, written = pairs[::2], pairs[1::2]
    if not rest or before or len(set(names)) < len(names) or not {"time", "position"} <= {*names}:
        return None
    known: dict[str, Any] = {}
    try:
        for name, value in zip(names, written, strict=True):
            numbers = [parse_number(number) for number in value.strip().strip("[]").split(",")]
            if name in ("time", "heading"):
                (known[name],) = numbers
            else:
                x, y, z = numbers
                known[name] = (x, y, z)
        return TrackOrder(rest[0], PlannedPoint(**known))
    except (UnitError, ValueError, TypeError):  # too few or too many numbers, or an unknown name
        return None


def _written(point: PlannedPoint) -> list[str]:
    """Return the words of a point, from which `_track` restores it exactly."""
    words = [f"time={point.time!r}"]
    for name in ("position", "velocity", "acceleration"):
        vector = getattr(point, name)
        if vector is not None:
            words.append(f"{name}=[{', '.join(map(repr, vector))}]")
    return words if point.heading is None else [*words, f"heading={point.heading!r}"]


_ASSIGNED = re.compile(r"(?:^| )([^\W\d]\w*)=")
_FORMS: Mapping[str, _Form] = {
    "emit": _Form(" EVENT", lambda rest: named(rest[0]) if len(rest) == 1 else None),
    "switch": _Form(" VEHICLE STATE [PARAMETER=VALUE ...]", _switch),
    "set": _Form(
        " OPTION VALUE",
        lambda rest: SetOption(rest[0], " ".join(rest[1:])) if len(rest) > 1 else None,
    ),
    "enable": _enable(True),
    "disable": _enable(False),
    "phase": _Form(" FLOW PHASE", lambda rest: EnterPhase(*rest) if len(rest) == 2 else None),
    "perform": _Form(" VEHICLE ACT", lambda rest: Perform(*rest) if len(rest) == 2 else None),
    **{word: _of_vehicles(kind) for word, kind in OF_VEHICLES.items()},
    "stop": _Form(" [REASON]", lambda rest: Stop(" ".join(rest))),
    "track": _Form(
        " VEHICLE time=SECONDS position=[X, Y, Z] [velocity=... acceleration=... heading=...]",
        _track,
    ),
    "release": _Form("", lambda rest: None if rest else ReleaseLease()),
}
WORDS = tuple(_FORMS)
"""The first words of all commands."""


SCHEDULE = "command line"
"""The name of the requester of scheduled commands."""
_FROM_ANYONE = (LandOrder, PauseOrder, Stop)


def is_for_anyone(order: Order) -> bool:
    """Return whether a command needs no lease, because it makes the flight safer."""
    return isinstance(order, _FROM_ANYONE)


class Lease:
    """The lease of a run. holder: the name of the person who holds it, or None."""

    def __init__(self) -> None:
        self.holder: str | None = None

    def objection(self, order: Order, by: str, take: bool) -> str | None:
        """Return why the person `by` may not give this command now. If they may, give them the
        lease if the command needs it, and return None. take: whether to take the lease from
        another."""
        if by == SCHEDULE or is_for_anyone(order):
            return None
        if self.holder not in (None, by) and not take:
            return f"`{self.holder}` commands this run; take the lease (`--take`) to command it"
        self.holder = None if isinstance(order, ReleaseLease) else by
        return None
