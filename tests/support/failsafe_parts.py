"""Parts for tests of the failsafe: a supervisor that alarms at given times, a tracker that notes
every setpoint, and an observer that gives orders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

from plans import part
from short_flights import NoParams

from kybflow.core.geometry import ZERO, distance
from kybflow.core.signals import NS, Alarm, Command, Reaction, Setpoint, Tick
from kybflow.dsl.plan import PartPlan
from kybflow.parts import Supervisor
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

LINE = "mission.yaml:7"


def alarming(
    *times: tuple[float, float, Reaction], event: str = "alarmed", passes: bool = False
) -> PartPlan:
    """A supervisor that asks for each reaction from one time to another, seconds of the run."""

    class Alarming(Supervisor[NoParams]):
        def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
            for begin, end, reaction in times:
                if begin * NS <= tick.now < end * NS:
                    return Alarm(event, reaction, "the test says so", 2.0, 1.0, passes=passes)
            return None

    return PartPlan("alarming", Alarming, NoParams(), f"supervisors.{event}", LINE)


def followed() -> tuple[PartPlan, list[tuple[float, Setpoint]]]:
    """A tracker, and what it follows: (seconds, setpoint) of every tick."""
    samples: list[tuple[float, Setpoint]] = []
    cascade = part("trackers", "cascade")

    class Watched(cascade.cls):
        def update(self, setpoint: Setpoint, tick: Tick) -> Command:
            samples.append((tick.now / NS, setpoint))
            return super().update(setpoint, tick)

    return replace(cascade, cls=Watched), samples


def largest_steps(samples: list[tuple[float, Setpoint]]) -> tuple[float, float]:
    """Between two ticks: (of the position, m; of the velocity, m/s)."""
    pairs = [(a, b) for (s, a), (t, b) in pairwise(samples) if t - s < 0.005]
    return (
        max(distance(a.position or ZERO, b.position or ZERO) for a, b in pairs),
        max(distance(a.velocity or ZERO, b.velocity or ZERO) for a, b in pairs),
    )


def orders(*given: tuple[float, Callable[[Vehicle], object]]) -> Callable[[Engine], None]:
    """An observer that gives each order to the first vehicle, once its time has come."""
    waiting = list(given)

    def observe(engine: Engine) -> None:
        while waiting and engine.seconds() >= waiting[0][0]:
            waiting.pop(0)[1](engine.vehicles[0])

    return observe
