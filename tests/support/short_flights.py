"""The states of short flights (up, hold, down), for plans built without YAML; and what such a
flight told, by vehicle and by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from plans import part, state, then, vehicle

from kybflow.core.signals import Event, Failed, Setpoint, SetpointKind, Tick
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import FaultPlan, VehiclePlan
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


def hovers(seconds: float = 4.0, name: str = "a", height: float = 0.6, **more: Any) -> VehiclePlan:
    """A vehicle that takes off, holds its place for a while and lands."""
    return vehicle(name, [up("hold", height), hold(seconds, "down"), down()], **more)


def fault(
    name: str,
    time: float | None = None,
    lasts: float | None = None,
    on: str = "a",
    when: Expression | None = None,
    **params: Any,
) -> FaultPlan:
    """A fault of the catalog: from a `time` on or `when` a condition holds, for as many seconds as
    it `lasts`."""
    own = part("faults", name, **params)
    return FaultPlan(part=own, vehicle=on, time=time, when=when, duration=lasts, at="m.yaml:9")


def path(told: list[Event], name: str) -> list[str]:
    """The states that a vehicle was in, in order."""
    return [
        str(e.fields["behavior"])
        for e in told
        if e.name == "behavior_started" and e.vehicle == name
    ]


def named(told: list[Event], *events: str) -> list[Event]:
    return [e for e in told if e.name in events]
