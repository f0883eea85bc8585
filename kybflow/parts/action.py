"""Actions: what a mission's callbacks do when an event occurs."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol

from kybflow.core.signals import Event
from kybflow.parts.base import P, Part

BUILT_IN = frozenset(
    {"switch", "set", "enable", "disable", "emit", "phase", "perform", "log", "stop"}
)
"""The actions that are part of the mission language."""


class ActionContext(Protocol):
    """The requests that an action can make. None of them makes a vehicle less safe: a safety part
    can't be disabled, its parameters only tighten, and a vehicle with a latched reaction refuses
    milder ones. Events about a request name the callback's line in the mission; a refusal is
    reported by an event too."""

    def switch(self, vehicle: str, state: str, values: tuple[tuple[str, Any], ...] = ()) -> None:
        """Request that a vehicle enters one of its states. values: new values (SI) of some of the
        state's parameters."""

    def set(self, option: str, value: Any) -> None:
        """Request a new value for an option, in SI units or as text with a unit."""

    def enable(self, vehicle: str, label: str, on: bool) -> None:
        """Request that a processor, labelled `processors.NAME`, is switched on or off."""

    def emit(self, name: str) -> None:
        """Emit a custom event, which is delivered in the next tick. Raises ValueError if the engine
        emits an event of this name."""

    def phase(self, flow: str, phase: str) -> None:
        """Request that a flow enters one of its phases."""

    def perform(self, vehicle: str, act: str) -> None:
        """Request that a vehicle performs one of its driver's `acts`."""

    def log(self, text: str) -> None:
        """Record `text` in a `logged` event."""

    def stop(self, reason: str) -> None:
        """Land every vehicle and end the run."""


class Action(Part[P]):
    """Something that a callback does, `do: [{NAME: {...}}]`. Created when the run begins. An action
    that raises is reported as the event `action_failed` and not called again. `events` are the
    names of the events that it emits."""

    kind = "actions"
    reserved = BUILT_IN

    def __init__(self, params: P) -> None:
        self.params = params

    @abstractmethod
    def __call__(self, event: Event, context: ActionContext) -> None:
        """React to `event`. Called once for each event that the callback listens to."""
