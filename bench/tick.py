"""How fast the whole stack is, against bare `mj_step` on the same model in the same run.

    python bench/tick.py [--vehicles 1 16] [--seconds 20]

Flies the vehicle `mk` of missions/figure_eight.yaml, one and sixteen of it, recording on. Every
twentieth of a simulated second the stack stops and a copy of the world makes as many bare steps, so
that whatever else the machine does slows both. The profile comes from a second flight, in which
each stage is timed; the clock's own cost is taken off. A rotorpy loop with its own controller runs
in the same process when it is installed.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import mujoco
from stages import Stages

from kybflow.api.flight import RunRequest, fly
from kybflow.drivers.sim import Sim
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts import Seat, Session
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

MISSION = Path(__file__).parent.parent / "missions" / "figure_eight.yaml"
GOALS = {1: 10.0, 16: 12.0}
SPACING = 3.0


class Shared(Sim):
    """The simulator, its session kept for the bench to see the model."""

    session: Any = None

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: Any) -> Session:
        cls.session = super().open(seats, generator)
        return cls.session


class Bare:
    """An observer that makes as many bare steps as the stack made since it was last called."""

    def __init__(self) -> None:
        self.stack: list[float] = []
        self.bare: list[float] = []
        self.simulated: list[float] = []
        self._left: tuple[float, float] | None = None
        self._copy: Any = None

    def __call__(self, engine: Engine) -> None:
        arrived, now = perf_counter(), engine.seconds()
        world = Shared.session
        if self._left is not None and engine.flying:
            steps = round((now - self._left[1]) / world.model.opt.timestep)
            self.stack.append(arrived - self._left[0])
            self.bare.append(self._steps(world, steps))
            self.simulated.append(now - self._left[1])
        self._left = (perf_counter(), now)

    def _steps(self, world: Any, steps: int) -> float:
        if self._copy is None:
            self._copy = mujoco.MjData(world.model)
        mujoco.mj_copyData(self._copy, world.model, world.data)
        model, data, step = world.model, self._copy, mujoco.mj_step
        began = perf_counter()
        for _ in range(steps):
            step(model, data)
        return perf_counter() - began


def plan_of(count: int, seconds: float) -> Plan:
    """`count` vehicles `mk` side by side, all on the figure eight; ends after `seconds`."""
    result = compile_mission(MISSION, catalog=load_catalog(), sets=("lap=10s",))
    if result.plan is None:
        raise SystemExit(f"{MISSION} does not compile: {result.diagnostics}")
    first = result.plan.vehicles[0]
    driver = dataclasses.replace(first.driver, cls=Shared)
    vehicles = tuple(_placed(first, driver, index) for index in range(count))
    return dataclasses.replace(
        result.plan, vehicles=vehicles, fence=None, expectations=(), time_limit=seconds
    )


def _placed(vehicle: VehiclePlan, driver: Any, index: int) -> VehiclePlan:
    start = (SPACING * (index % 4), SPACING * (index // 4), 0.0)
    return dataclasses.replace(vehicle, name=f"v{index}", start=start, driver=driver)


def flown(plan: Plan, observers: Sequence[Any] = ()) -> None:
    with tempfile.TemporaryDirectory() as folder:
        fly(plan, RunRequest(out=Path(folder) / "run"), observers=observers)


def measure(count: int, seconds: float) -> None:
    """Print one row: the ratio as the median over slices, and as the quotient of the sums."""
    bare = Bare()
    flown(plan_of(count, seconds), (bare,))
    ratios = [s / b for s, b in zip(bare.stack, bare.bare, strict=True)]
    stack, alone, simulated = sum(bare.stack), sum(bare.bare), sum(bare.simulated)
    steps = simulated / Shared.session.model.opt.timestep
    print(
        f"{count:8d}  {alone / steps * 1e6:9.2f}  {stack / steps * 1e6:9.2f}"
        f"  {statistics.median(ratios):6.2f}  {stack / alone:6.2f}  {GOALS.get(count, 12.0):5.0f}"
        f"  {simulated / stack:9.1f}"
    )


def profile(count: int, seconds: float) -> None:
    """Print where the tick's time goes."""
    plan, bare = plan_of(count, seconds), Bare()
    stages = Stages(plan)
    with stages:
        flown(plan, (bare,))
    ticks = sum(bare.simulated) * plan.control_rate
    physics = sum(bare.bare)
    total = sum(bare.stack) - stages.overhead
    seconds_of = dict(stages.seconds)
    seconds_of["on-board control and sensors"] = seconds_of.pop("simulator") - physics
    seconds_of["physics (mj_step)"] = physics
    seconds_of["engine, events and the rest"] = total - sum(seconds_of.values())
    print(f"\ntick of {count} vehicle(s), by stage{' ' * 14}us/tick   share")
    for stage, spent in sorted(seconds_of.items(), key=lambda item: -item[1]):
        print(f"  {stage:40s} {spent / ticks * 1e6:9.2f}  {spent / total:6.1%}")


def rotorpy_loop(seconds: float = 2.0) -> None:
    """Print the real-time factor of rotorpy's own simulation and controller at 100 Hz."""
    try:
        from rotorpy_loop import real_time_factor
    except ImportError as error:
        print(f"\nrotorpy: skipped, {error}")
        return
    factor = real_time_factor(seconds)
    print(f"\nrotorpy, one vehicle, its SE3 controller at 100 Hz: {factor:.1f} x real time")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--vehicles", type=int, nargs="+", default=[1, 16])
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated, per flight")
    options = parser.parse_args()
    print(f"python {sys.version.split()[0]}, mujoco {mujoco.__version__}, recording on")
    print("vehicles  bare us/st  stack us/st  median   total   goal  real-time")
    for count in options.vehicles:
        measure(count, options.seconds)
    for count in options.vehicles:
        profile(count, min(options.seconds, 8.0))
    rotorpy_loop()


if __name__ == "__main__":
    main()
