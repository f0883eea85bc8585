"""Flights of the figure eight whose ticks are counted in bytecodes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from bytecodes import Bytecodes
from toolchain import MISSIONS

from kybflow.api.flight import RunRequest, fly
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

MISSION = MISSIONS / "figure_eight.yaml"


def fleet(count: int, target: str | None = None) -> Plan:
    """`count` of the figure eight's first vehicle, three metres apart."""
    plan = compile_mission(
        MISSION, catalog=load_catalog(), target=target, sets=("lap=10s",)
    ).plan  # fmt: skip
    assert plan is not None
    first = plan.vehicles[0]
    vehicles = tuple(
        dataclasses.replace(first, name=f"v{index}", start=(3.0 * index, 0.0, 0.0))
        for index in range(count)
    )
    return dataclasses.replace(plan, vehicles=vehicles, fence=None, expectations=())


def per_tick(
    plan: Plan, bytecodes: Bytecodes, since: float, seconds: float, out: Path
) -> Mapping[str, float]:
    """Fly and return the bytecodes of each stage, a vehicle and tick, counted for `seconds`."""
    span: list[float] = []

    def watch(engine: Engine) -> None:
        now = engine.seconds()
        if not span and now >= since:
            assert all(vehicle.runner.off_ground for vehicle in engine.vehicles)
            span.append(now)
            bytecodes.start()
        elif len(span) == 1 and now >= span[0] + seconds - 1e-6:
            bytecodes.stop()
            span.append(now)

    ending = dataclasses.replace(plan, time_limit=since + seconds + 0.1)
    fly(ending, RunRequest(out=out), observers=(watch,))
    ticks = round((span[1] - span[0]) * plan.control_rate)
    every = ticks * len(plan.vehicles)
    return {stage: number / every for stage, number in bytecodes.counts.items()}
