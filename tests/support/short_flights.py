"""The states of short flights (up, hold, down), for plans built without YAML; and what such a
flight told, by vehicle and by name."""

from __future__ import annotations

from dataclasses import dataclass

from plans import part, state, then

from kybflow.core.signals import Event, Failed, Setpoint, SetpointKind, Tick
from kybflow.parts import AIR, Behavior, Entry


@dataclass(frozen=True)
class NoParams:
    pass


class Still(Behavior[NoParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Holds its entry position; tests change what `update` does."""

    def __init__(self, params: NoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self.setpoint = Setpoint(
            SetpointKind.POSITION, entry.position, (0.0,) * 3, (0.0,) * 3, heading=entry.heading
        )

    def update(self, tick: Tick) -> Setpoint | Failed:
        return self.setpoint


def up(target: str, height: float = 0.6):
    return state("up", part("behaviors", "take_off", height=height), then(target))


def down():
    return state("down", part("behaviors", "land"), then("landed"))


def hold(seconds: float, target: str):
    return state("hold", part("behaviors", "hover", for_time=seconds), then(target))


def path(told: list[Event], name: str) -> list[str]:
    """The states that a vehicle was in, in order."""
    return [
        str(e.fields["behavior"])
        for e in told
        if e.name == "behavior_started" and e.vehicle == name
    ]


def named(told: list[Event], *events: str) -> list[Event]:
    return [e for e in told if e.name in events]
