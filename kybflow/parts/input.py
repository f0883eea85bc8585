"""Inputs: the devices with which a person steers and emits events."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from kybflow.core.geometry import Vec3
from kybflow.core.signals import InputReading, Sticks, Time
from kybflow.parts.base import Objection, P, Part

AXES = ("x", "y", "z", "turn")
"""The axes by which a vehicle is steered: forward, to the left, up, counter-clockwise."""
SticksOf = Callable[[str], Sticks | None]
"""Gives the pilot's sticks that a vehicle reported last, None while it has reported none."""


class InputLink(ABC):
    """An open input. The engine reads it once a tick."""

    @abstractmethod
    def read(self, now: Time) -> InputReading | None:
        """Return the newest reading, None before the first. A button that went down since the last
        call counts as held, however short it was. Raises DriverError."""

    def trouble(self) -> str | None:
        """Return why the device delivers nothing, in words for a person; None if no problem is
        known."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release the device."""


class FeltLink(InputLink):
    """An open input that pushes back."""

    @abstractmethod
    def apply_force(self, push: Vec3 | None) -> None:
        """Apply the force `push` to the hand, along the axes x, y and z, about 1 for a full
        mismatch; None for no force, while what it steers is held or the input is lost. Called once
        a tick, after `read`. Raises DriverError."""


class Input(Part[P]):
    """Gives axes, each -1 to 1, and buttons. A button emits the event `INPUT.BUTTON`.

    stuck_after: seconds after which an axis away from its centre that gives the same number over
    and over is stuck, unless the mission says otherwise; None for a device whose axes have steps.
    reads_terminal: it reads the keys of the terminal, so that nothing else may.
    """

    kind = "inputs"
    helpers = frozenset({"deflection", "haptics", "rows", "sdl"})
    stuck_after: ClassVar[float | None] = 10.0
    reads_terminal: ClassVar[bool] = False

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Return whether a person uses it, so that a simulation with it must run in real time."""
        return True

    @classmethod
    def axes(cls, params: P) -> tuple[str, ...]:
        """Return the names of its axes."""
        return AXES

    @classmethod
    @abstractmethod
    def buttons(cls, params: P) -> tuple[str, ...]:
        """Return the names of its buttons."""

    @classmethod
    def objection(cls, params: P) -> Objection | None:
        """Return why it can't work with these parameters, None if it can."""
        return None

    @classmethod
    @abstractmethod
    def open(cls, params: P, sticks_of: SticksOf) -> InputLink:
        """Open the device. Raises DriverError."""
