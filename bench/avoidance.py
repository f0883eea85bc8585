"""How near vehicles come to each other and to obstacles, and how long they stand still in the way.

    python bench/avoidance.py MISSION FIRST LAST [--set NAME=VALUE ...]

Flies a mission with each seed and prints, by the simulator's truth, twenty times a second: the
least distance of two vehicles in the air, between centres and between hulls, and of a hull from an
obstacle and from a moving one; the longest time that a vehicle stood still in a behavior that goes
somewhere; and what of the mission's expectations did not hold.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from itertools import combinations
from math import inf
from pathlib import Path

from kybflow.api.flight import RunRequest, fly
from kybflow.core.geometry import distance, norm
from kybflow.core.signals import NS
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

STILL = 0.05
"""m/s."""
WAITING = frozenset({"hover", "brake", "take_off", "land", "wait_on_ground", "steer"})
"""Behaviors in which a vehicle may stand still."""


class Nearness:
    """An observer of a run."""

    def __init__(self) -> None:
        self.apart = self.between = self.clear = self.ball = inf
        self.longest = 0.0
        self._since: dict[str, float] = {}

    def __call__(self, engine: Engine) -> None:
        flying = [v for v in engine.vehicles if v.truth is not None and v.airborne]
        for one, other in combinations(flying, 2):
            apart = distance(one.truth.position, other.truth.position)
            hulls = one.context.airframe.hull + other.context.airframe.hull
            self.apart = min(self.apart, apart)
            self.between = min(self.between, apart - hulls)
        for vehicle in flying:
            self.clear = min(self.clear, *_rooms(vehicle))
            self.ball = min(self.ball, *_balls(vehicle, engine.clock.now / NS))
            self._look(vehicle, engine.seconds())

    def _look(self, vehicle: Vehicle, now: float) -> None:
        moves = norm(vehicle.truth.velocity) > STILL
        if moves or vehicle.runner.state.behavior.name in WAITING:
            self._since.pop(vehicle.name, None)
        self.longest = max(self.longest, now - self._since.setdefault(vehicle.name, now))


def _rooms(vehicle: Vehicle) -> Iterator[float]:
    yield inf
    yield inf
    for shape in vehicle.context.obstacles.values():
        yield shape.distance(vehicle.truth.position) - vehicle.context.airframe.hull


def _balls(vehicle: Vehicle, seconds: float) -> Iterator[float]:
    yield inf
    yield inf
    for ball in vehicle.context.moving.values():
        apart = distance(ball.at(seconds), vehicle.truth.position)
        yield apart - ball.radius - vehicle.context.airframe.hull


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("mission", type=Path)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    chosen = parser.parse_args()
    result = compile_mission(chosen.mission, catalog=load_catalog(), sets=chosen.set)
    assert result.plan is not None, result.diagnostics
    print("seed   centres     hulls  obstacle    moving  stood  time")
    rows = []
    for seed in range(chosen.first, chosen.last + 1):
        near = Nearness()
        with tempfile.TemporaryDirectory() as place:
            request = RunRequest(out=Path(place) / "run", seed=seed)
            summary = fly(result.plan, request, observers=(near,)).summary
        rows.append((near.apart, near.between, near.clear, near.ball, -near.longest))
        failed = "" if summary["outcome"] == "succeeded" else f"  {summary['reason']}"
        print(
            f"{seed:4d} {near.apart:7.3f} m {near.between:7.3f} m {near.clear:7.3f} m"
            f" {near.ball:7.3f} m {near.longest:4.1f} s {summary['sim_time_s']:5.1f} s{failed}",
            flush=True,
        )
    worst = [min(column) for column in zip(*rows, strict=True)]
    print("all " + "".join(f" {metres:7.3f} m" for metres in worst[:4]) + f" {-worst[4]:4.1f} s")


if __name__ == "__main__":
    main()
