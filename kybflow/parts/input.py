"""Inputs: the devices with which a person steers vehicles and emits events."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from kybflow.core.geometry import Vec3
from kybflow.core.signals import InputReading, MeasurementKind, Sticks, Time
from kybflow.parts.base import Objection, P, Part

AXES = ("x", "y", "z", "turn")
"""The axes by which a vehicle is steered: forward, to the left, up, counter-clockwise."""
SticksOf = Callable[[str], Sticks | None]
"""Returns the pilot's sticks that a vehicle, given by name, reported last; None if it has reported
none."""


class InputLink(ABC):
    """An open input. The engine reads it once a tick."""

    @abstractmethod
    def read(self, now: Time) -> InputReading | None:
        """Return the newest reading, None before the first. A button that was pressed since the
        last call counts as held, however short the press was. Raises DriverError."""

    def trouble(self) -> str | None:
        """Return a human-readable reason why the device delivers nothing, or None if no problem is
        known."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release the device."""


class FeltLink(InputLink):
    """An open input with force feedback."""

    @abstractmethod
    def apply_force(self, push: Vec3 | None) -> None:
        """Apply the force `push` to the hand, along the axes x, y and z, about 1 for a full
        mismatch. None applies no force: the steered vehicle is paused or the input is lost. Called
        once a tick, after `read`. Raises DriverError."""


class Input(Part[P]):
    """Provides axes, each -1 to 1, and buttons. A pressed button emits the event `INPUT.BUTTON`.

    stuck_after: seconds after which an axis away from its centre counts as stuck if it repeats one
    value, unless the mission sets another time; None for a device whose axes have steps.
    terminal_keys: the keys of the terminal that it reads, and what they do, as the live table shows
    them; nothing else may then read the terminal. Empty if it reads none.
    reported_as: the measurement with which the vehicle of its parameter `vehicle` reports it; None
    for a device of this computer.
    """

    kind = "inputs"
    helpers = frozenset({"deflection", "haptics", "rows", "sdl"})
    stuck_after: ClassVar[float | None] = 10.0
    terminal_keys: ClassVar[str] = ""
    reported_as: ClassVar[MeasurementKind | None] = None

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Return whether a person uses the input, so that a simulation with it must run in real
        time."""
        return True

    @classmethod
    def axes(cls, params: P) -> tuple[str, ...]:
        """Return the names of the axes."""
        return AXES

    @classmethod
    @abstractmethod
    def buttons(cls, params: P) -> tuple[str, ...]:
        """Return the names of the buttons."""

    @classmethod
    def objection(cls, params: P) -> Objection | None:
        """Return why the input can't work with these parameters, or None if it can."""
        return None

    @classmethod
    @abstractmethod
    def open(cls, params: P, sticks_of: SticksOf) -> InputLink:
        """Open the device. Raises DriverError."""
