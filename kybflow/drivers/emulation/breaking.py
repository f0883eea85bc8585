"""Injected failures of an emulated vehicle, written `NAME[=VALUE][@SECONDS]`.

The names are the fields of a `Failures` dataclass. A field that is False by default is a switch and
takes no value, a string field takes text, and any other takes a number. An emulator adds its own
failures by a subclass. `heal` ends all failures.
"""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import Field, dataclass, fields
from typing import Any, NamedTuple, TypeVar

from kybflow.core.errors import DriverError, UnitError
from kybflow.core.signals import NS, Time
from kybflow.core.units import finite_number

HEAL = "heal"
SHARES = frozenset({"drop", "battery"})
"""The failures whose value is a fraction."""
Message = TypeVar("Message")


@dataclass
class Failures:
    """The failures of any emulated vehicle.

    silent: it sends nothing.
    deaf: it receives nothing.
    drop: the fraction of all messages that is lost, in both directions.
    battery: the charge that it measures, 0 to 1; None for the simulated battery's.
    """

    silent: bool = False
    deaf: bool = False
    drop: float = 0.0
    battery: float | None = None


class Break(NamedTuple):
    """A failure and the time at which it begins."""

    at: Time
    name: str
    value: str

    def __str__(self) -> str:
        return f"{self.name}={self.value}" if self.value else self.name

    def apply(self, failures: Failures) -> None:
        for field in fields(failures):
            if self.name == HEAL:
                setattr(failures, field.name, field.default)
            elif self.name == field.name:
                setattr(failures, field.name, _value(field, self.value))


def read_break(text: str, kind: type[Failures]) -> Break:
    """Parse a failure. Raises DriverError, which says what can be written. kind: the emulator's
    failures."""
    what, _, seconds = text.partition("@")
    name, _, value = what.partition("=")
    known = {field.name: field for field in fields(kind)}
    if name not in known and name != HEAL:
        names = ", ".join(sorted((*known, HEAL)))
        raise DriverError(f"nothing called `{name}` can fail; there are {names}")
    is_switch = name == HEAL or known[name].default is False
    if is_switch == bool(value):
        wants = "takes no value" if value else f"needs a value, as in `{name}=...`"
        raise DriverError(f"`{text}`: `{name}` {wants}")
    try:
        at = finite_number(seconds or "0")
        given = 0.0 if is_switch else _value(known[name], value)
    except UnitError:
        raise DriverError(f"`{text}` is not NAME[=VALUE][@SECONDS]") from None
    if name in SHARES and isinstance(given, float) and not 0.0 <= given <= 1.0:
        raise DriverError(f"`{text}`: `{name}` is from 0 to 1")
    if at < 0.0:
        raise DriverError(f"`{text}` begins before 0 s")
    return Break(round(at * NS), name, value)


def _value(field: Field[Any], text: str) -> bool | float | str:
    if field.default is False:
        return True
    return text if isinstance(field.default, str) else finite_number(text)


class BreakableLink:
    """Drops messages from and to an emulated vehicle according to its failures."""

    def __init__(self, failures: Failures, generator: random.Random) -> None:
        self._failures, self._generator = failures, generator

    def received(self, messages: Iterable[Message]) -> list[Message]:
        """Return the messages that arrive; failures may drop some or all of them."""
        if self._failures.deaf:
            return []
        return [message for message in messages if not self._is_lost()]

    def sends(self) -> bool:
        """Return whether the next message is sent."""
        return not (self._failures.silent or self._is_lost())

    def _is_lost(self) -> bool:
        return self._failures.drop > 0.0 and self._generator.random() < self._failures.drop
