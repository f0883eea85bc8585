"""How fast the whole stack is, against bare `mj_step` on a frozen model in the same run.

    python bench/tick.py [--vehicles 1 16 64] [--seconds 20]

Flies the vehicle `mk` of missions/figure_eight.yaml, one and more of it, recording on. Every
twentieth of a simulated second the stack stops and the frozen model (`frozen_model`), its vehicles
put where the flight's are, makes as many bare steps, so that whatever else the machine does slows
both. The profile comes from a second flight, in which each stage is timed; the clock's own cost is
taken off. A rotorpy loop with its own controller runs in the same process when it is installed.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any

import mujoco
from frozen_model import frozen_model, hovering
from stages import Stages

from kybflow.api.flight import RunRequest, fly
from kybflow.drivers.sim import Sim
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts import Seat, Session
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle import vehicle

MISSION = Path(__file__).parent.parent / "missions" / "figure_eight.yaml"
IS_COMPILED = not str(vehicle.__file__).endswith(".py")
GOALS = {1: 9.0, 16: 7.0, 64: 4.0} if IS_COMPILED else {1: 14.0, 16: 14.0, 64: 8.0}
"""The most that an install may take, compiled by mypyc or not, in bare steps of the frozen
model."""
ROTORPY_GOAL = 11.0
SPACING = 3.0


class Shared(Sim):
    """The simulator, its session kept for the bench to see the model."""

    session: Any = None

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: Any) -> Session:
        cls.session = super().open(seats, generator)
        return cls.session


class Bare:
    """An observer that makes as many bare steps of the frozen model as the stack made since it was
    last called."""

    def __init__(self) -> None:
        self.stack: list[float] = []
        self.bare: list[float] = []
        self.simulated: list[float] = []
        self._left: tuple[float, float] | None = None
        self._frozen: tuple[Any, Any] | None = None

    def __call__(self, engine: Engine) -> None:
        arrived, now = process_time(), engine.seconds()
        world = Shared.session
        if self._left is not None and engine.flying:
            steps = round((now - self._left[1]) / world.model.opt.timestep)
            self.stack.append(arrived - self._left[0])
            self.bare.append(self._steps(world, steps))
            self.simulated.append(now - self._left[1])
        self._left = (process_time(), now)

    def _steps(self, world: Any, steps: int) -> float:
        if self._frozen is None:
            model = frozen_model(world.data.qpos.reshape(-1, 7)[:, :3].tolist())
            self._frozen = (model, hovering(model))
        (model, data), step = self._frozen, mujoco.mj_step
        data.qpos[:], data.qvel[:] = world.data.qpos, world.data.qvel
        began = process_time()
        for _ in range(steps):
            step(model, data)
        return process_time() - began


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


def _placed(one: VehiclePlan, driver: Any, index: int) -> VehiclePlan:
    start = (SPACING * (index % 4), SPACING * (index // 4), 0.0)
    return dataclasses.replace(one, name=f"v{index}", start=start, driver=driver)


def flown(plan: Plan, observers: Sequence[Any] = ()) -> None:
    with tempfile.TemporaryDirectory() as folder:
        fly(plan, RunRequest(out=Path(folder) / "run"), observers=observers)


def measured(count: int, seconds: float) -> Bare:
    bare = Bare()
    flown(plan_of(count, seconds), (bare,))
    return bare


def measure(count: int, seconds: float) -> None:
    """Print one row: the ratio as the median over slices, and as the quotient of the sums."""
    bare = measured(count, seconds)
    ratios = [s / b for s, b in zip(bare.stack, bare.bare, strict=True)]
    stack, alone, simulated = sum(bare.stack), sum(bare.bare), sum(bare.simulated)
    goal = GOALS.get(count, GOALS[1])
    steps = simulated / Shared.session.model.opt.timestep
    print(
        f"{count:8d}  {alone / steps * 1e6:9.2f}  {stack / steps * 1e6:9.2f}"
        f"  {statistics.median(ratios):6.2f}  {stack / alone:6.2f}  {goal:5.0f}"
        f"  {simulated / stack:9.1f}"
    )


def profile(count: int, seconds: float) -> None:
    """Print where the tick's time goes."""
    plan, bare = plan_of(count, seconds), Bare()
    stages = Stages(plan)
    with stages:
        flown(plan, (bare,))
    ticks = sum(bare.simulated) * plan.control_rate
    total = sum(bare.stack) - stages.overhead
    seconds_of = dict(stages.seconds)
    seconds_of["engine, events and the rest"] = total - sum(seconds_of.values())
    print(f"\ntick of {count} vehicle(s), by stage{' ' * 14}us/tick   share")
    for stage, spent in sorted(seconds_of.items(), key=lambda item: -item[1]):
        print(f"  {stage:40s} {spent / ticks * 1e6:9.2f}  {spent / total:6.1%}")


def beside_rotorpy(rounds: int = 3) -> None:
    """Print how much faster than rotorpy's own simulation and controller at 100 Hz one vehicle
    flies, the two in turns."""
    try:
        from rotorpy_loop import real_time_factor
    except ImportError as error:
        print(f"\nrotorpy: skipped, {error}")
        return
    pairs = []
    for _ in range(rounds):
        theirs, bare = real_time_factor(2.0), measured(1, 10.0)
        pairs.append((sum(bare.simulated) / sum(bare.stack), theirs))
    ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"\nreal time, one vehicle: {ours:.1f} x, rotorpy's loop {theirs:.1f} x")
    print(f"  ratio (median of pairs) {ratio:.1f}, goal {ROTORPY_GOAL:.0f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--vehicles", type=int, nargs="+", default=[1, 16, 64])
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated, per flight")
    options = parser.parse_args()
    print(f"python {sys.version.split()[0]}, mujoco {mujoco.__version__}, recording on")
    print("vehicles  bare us/st  stack us/st  median   total   goal  real-time")
    for count in options.vehicles:
        measure(count, options.seconds)
    for count in options.vehicles:
        profile(count, min(options.seconds, 8.0))
    beside_rotorpy()


if __name__ == "__main__":
    main()
