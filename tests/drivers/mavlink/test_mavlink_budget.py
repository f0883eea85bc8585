"""What the driver does for a vehicle in a tick, in bytecodes: receives, parses, acts, sends.

A change that adds more than 3 % raises the budget below in the same commit and says why.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

pytest.importorskip("pymavlink")

from bytecodes import Bytecodes, needs_repeatable_counts, off_budget

from kybflow.api.flight import RunRequest, fly
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

MISSION = Path(__file__).parents[3] / "missions" / "figure_eight.yaml"
FROM, FOR = 12.0, 1.0
"""Seconds: in the middle of the eight, with every stream and each of our heartbeats."""
DRIVER = "MAVLink driver"
STAGES = (
    *(
        (f"drivers/mavlink/{module}", DRIVER)
        for module in ("session", "link", "contact", "control", "preflight", "telemetry")
    ),
    ("drivers/mavlink/transport/router", DRIVER),
    ("drivers/emulat", "emulator"),
    ("drivers/sim", "emulator"),
    ("runtime/", "runtime"),
    ("recording/", "runtime"),
)
"""Framing, codec and wires belong to whoever calls them: the emulator uses them too."""
BUDGET = {("px4", 1): 2098, ("px4", 4): 2091, ("ardupilot", 1): 2072}
"""Bytecodes a vehicle and tick, by firmware and number of vehicles."""


def fleet(firmware: str, count: int) -> Plan:
    """`count` of the figure eight's first vehicle, three metres apart."""
    target = f"emulated_{firmware}"
    plan = compile_mission(
        MISSION, catalog=load_catalog(), target=target, sets=("lap=10s",)
    ).plan  # fmt: skip
    assert plan is not None
    first = plan.vehicles[0]
    vehicles = tuple(
        dataclasses.replace(first, name=f"v{index}", start=(3.0 * index, 0.0, 0.0))
        for index in range(count)
    )
    return dataclasses.replace(
        plan, vehicles=vehicles, fence=None, expectations=(), time_limit=FROM + FOR + 0.1
    )


@needs_repeatable_counts
@pytest.mark.parametrize(("firmware", "count"), BUDGET)
def test_the_driver_stays_within_its_budget(firmware: str, count: int, tmp_path: Path) -> None:
    bytecodes = Bytecodes(STAGES, "runtime")
    span: list[float] = []

    def watch(engine: Engine) -> None:
        now = engine.seconds()
        if not span and now >= FROM:
            assert all(vehicle.activity.off_ground for vehicle in engine.vehicles)
            span.append(now)
            bytecodes.start()
        elif len(span) == 1 and now >= span[0] + FOR - 1e-6:
            bytecodes.stop()
            span.append(now)

    plan = fleet(firmware, count)
    fly(plan, RunRequest(out=tmp_path / "run"), observers=(watch,))
    ticks = round((span[1] - span[0]) * plan.control_rate)
    found = {DRIVER: bytecodes.counts[DRIVER] / ticks / count}
    lines = off_budget(found, {DRIVER: BUDGET[firmware, count]})
    assert not lines, "\n".join(["", *lines])
