"""Actions: what a mission's callbacks do when an event is heard."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol

from kybflow.parts.base import P, Part
from kybflow.signals import Event


class Deck(Protocol):
    """What an action may do. Nothing here makes a vehicle less safe: a safety part can't be
    switched off, its parameters only tighten, and a latched vehicle refuses what is milder. Who
    asks is told as `by`, the mission line as `at`; a refusal is an event."""

    def switch(self, vehicle: str, state: str, by: str, at: str) -> None:
        """Ask a vehicle to enter one of its states."""

    def set(self, option: str, value: Any, by: str) -> None:
        """Ask for another value of an option."""

    def enable(self, vehicle: str, label: str, on: bool, by: str) -> None:
        """Switch a processor that is no safety part on or off."""

    def emit(self, name: str, at: str) -> None:
        """Tell an event of the run."""

    def phase(self, flow: str, phase: str, by: str, at: str) -> None:
        """Ask a flow to enter one of its phases."""

    def stop(self, reason: str) -> None:
        """Land every vehicle and end the run."""


class Action(Part[P]):
    """Something that a callback does, `do: [{NAME: {...}}]`. Made when the run begins, called once
    for each event that the callback hears. One that raises is told as an event and left out."""

    kind = "actions"

    def __init__(self, params: P) -> None:
        self.params = params

    @abstractmethod
    def __call__(self, event: Event, deck: Deck) -> None: ...
