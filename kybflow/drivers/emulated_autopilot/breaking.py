"""What fails in an emulated autopilot on purpose, as a person writes it: `NAME[=VALUE][@SECONDS]`.

silent: it sends nothing. deaf: it hears nothing. blind: it sees no external vision. battery=0.1:
the charge that it believes to have. refuse=WORDS: it can't be armed. bar=WORDS: it changes no mode.
drop=0.2: that part of its messages is lost. tilt=30: it believes to lean so far, degrees.
pilot=MODE: a transmitter is switched on and takes it into that mode. heal: all is well again.
"""

from __future__ import annotations

from dataclasses import fields
from math import radians
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.emulated_autopilot.state import Failures

if TYPE_CHECKING:
    from kybflow.drivers.emulated_autopilot.autopilot import Autopilot

SWITCHES = frozenset({"silent", "deaf", "blind", "heal"})
NUMBERS = frozenset({"battery", "drop", "tilt"})
WORDS = frozenset({"refuse", "bar", "pilot"})


class Break(NamedTuple):
    """Something that fails at a time."""

    at: Time
    name: str
    value: str

    def __str__(self) -> str:
        return f"{self.name}={self.value}" if self.value else self.name

    def apply(self, autopilot: Autopilot) -> None:
        """Let it fail."""
        broken, name, value = autopilot.failures, self.name, self.value
        if name == "heal":
            for field in fields(Failures):
                setattr(broken, field.name, field.default)
        elif name in SWITCHES:
            setattr(broken, name, True)
        elif name == "battery":
            broken.battery = float(value)
        elif name == "drop":
            broken.drops = float(value)
        elif name == "tilt":
            broken.leans = radians(float(value))
        elif name == "refuse":
            broken.refuses = value
        elif name == "bar":
            broken.bars = value
        else:
            autopilot.give_to_pilot(value)


def read_break(text: str) -> Break:
    """Raises DriverError with what can be written."""
    what, _, seconds = text.partition("@")
    name, _, value = what.partition("=")
    if name not in SWITCHES | NUMBERS | WORDS:
        known = ", ".join(sorted(SWITCHES | NUMBERS | WORDS))
        raise DriverError(f"nothing called `{name}` can fail; there are {known}")
    if (name in SWITCHES) == bool(value):
        wants = "takes no value" if value else f"needs a value, as in `{name}=...`"
        raise DriverError(f"`{text}`: `{name}` {wants}")
    try:
        at = float(seconds or 0.0)
        if name in NUMBERS:
            float(value)
    except ValueError:
        raise DriverError(f"`{text}` is not NAME[=VALUE][@SECONDS]") from None
    return Break(round(at * NS), name, value)
