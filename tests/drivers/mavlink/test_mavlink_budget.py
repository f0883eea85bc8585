"""What the driver does for a vehicle in a tick, in bytecodes: receives, parses, acts, sends.

A change that adds more than 3 % raises the budget below in the same commit and says why.
"""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("pymavlink")

from budget_flights import fleet, per_tick
from bytecodes import Bytecodes, needs_repeatable_counts, off_budget

FROM, FOR = 12.0, 1.0
"""Seconds: in the middle of the eight, with every stream and each of our heartbeats."""
DRIVER = "MAVLink driver"
STAGES = (
    *(
        (f"drivers/mavlink/{module}", DRIVER)
        for module in ("link", "autopilot_state", "control", "preflight", "telemetry")
    ),
    ("drivers/mavlink/transport/router", DRIVER),
    ("drivers/emulat", "emulator"),
    ("drivers/sim", "emulator"),
    ("runtime/", "runtime"),
    ("recording/", "runtime"),
)
"""Framing, codec and wires belong to whoever calls them: the emulator uses them too."""
BUDGET = {("px4", 1): 2279, ("px4", 4): 2273, ("ardupilot", 1): 2238}
"""Bytecodes a vehicle and tick, by firmware and number of vehicles."""


@needs_repeatable_counts
@pytest.mark.parametrize(
    ("firmware", "count"),
    [
        pytest.param(*key, marks=[pytest.mark.thorough] if key != ("px4", 1) else [])
        for key in BUDGET
    ],
)
def test_the_driver_stays_within_its_budget(firmware: str, count: int, tmp_path: Path) -> None:
    plan = fleet(count, f"emulated_{firmware}")
    found = per_tick(plan, Bytecodes(STAGES, "runtime"), FROM, FOR, tmp_path / "run")
    lines = off_budget({DRIVER: found[DRIVER]}, {DRIVER: BUDGET[firmware, count]})
    assert not lines, "\n".join(["", *lines])
