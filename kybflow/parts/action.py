"""Actions: what a mission's callbacks do when an event is heard."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol

from kybflow.core.signals import Event
from kybflow.parts.base import P, Part

BUILT_IN = frozenset({"switch", "set", "enable", "disable", "emit", "phase", "log", "stop"})
"""The actions that the language has itself."""


class ActionContext(Protocol):
    """What an action may do. Nothing here makes a vehicle less safe: a safety part can't be
    switched off, its parameters only tighten, and a latched vehicle refuses what is milder. Each
    wish is told with the callback's line; a refusal is an event."""

    def switch(self, vehicle: str, state: str) -> None:
        """Ask a vehicle to enter one of its states."""

    def set(self, option: str, value: Any) -> None:
        """Ask for another value of an option: SI, or text with a unit."""

    def enable(self, vehicle: str, label: str, on: bool) -> None:
        """Switch a processor that is no safety part on or off, by its label
        `processors.NAME`."""

    def emit(self, name: str) -> None:
        """Tell a custom event; everything hears it in the next tick. Raises ValueError for the
        name of an event that the engine tells itself."""

    def phase(self, flow: str, phase: str) -> None:
        """Ask a flow to enter one of its phases."""

    def log(self, text: str) -> None:
        """Say something for the record."""

    def stop(self, reason: str) -> None:
        """Land every vehicle and end the run."""


class Action(Part[P]):
    """Something that a callback does, `do: [{NAME: {...}}]`. Made when the run begins, called once
    for each event that the callback hears. One that raises is told as an event and left out.
    `events` are the names that it emits."""

    kind = "actions"
    reserved = BUILT_IN

    def __init__(self, params: P) -> None:
        self.params = params

    @abstractmethod
    def __call__(self, event: Event, context: ActionContext) -> None: ...
