"""npm's `ar-drone` takes an emulated drone for a real one."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from ardrone_recordings import package
from served_drones import served
from waiting import HANGS

pytestmark = pytest.mark.peer
STEPS = [
    "connected", "full", "hovering", "forward", "turned", "climbed", "landed", "rising",
    "emergency", "recovered", "flying again", "down",
]  # fmt: skip


def test_it_connects_flies_lands_and_recovers_from_an_emergency():
    script = Path(__file__).parent / "npm_client.js"
    node = ["node", "--no-deprecation", str(script), str(package())]
    with served() as drones:
        done = subprocess.run(
            [*node, drones.host], capture_output=True, text=True, timeout=HANGS, check=False
        )
        assert done.stdout.splitlines() == STEPS, done.stderr + "".join(drones.said)
