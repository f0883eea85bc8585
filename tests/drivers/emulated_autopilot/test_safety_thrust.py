"""A simulated vehicle that suddenly needs more thrust, or thrust elsewhere, stays in the air: in a
lab on the simulator's loop, on emulated autopilots in still air. In a lab these sink under 1.6
times their weight: the nano_plus's quick loop has no torque left for a filter and a dead time."""

from __future__ import annotations

from pathlib import Path

import pytest
from flight_judge import judge
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

pytest.importorskip("pymavlink.dialects.v20.all", reason="pymavlink is not installed")
pytestmark = pytest.mark.thorough

MISSION = """
kybflow: 1
mission: burdened
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 3]}}}}
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up: {{do: take_off, height: {height} m, within: 15 s, then: still}}
      still: {{do: hover, for_time: 15 s, then: down}}
      down: {{do: land}}
targets:
  emulated_px4: {{all: {{driver: {{use: emulated_autopilot, calm: true}}}}}}
  emulated_ardupilot:
    {{all: {{driver: {{use: emulated_autopilot, autopilot: ardupilot, calm: true}}}}}}
faults:
- {{when: behavior == still and elapsed > 2 s, on: a, inject: {fault}}}
"""
BURDENS = {
    "a load": (1.0, "mass_change, factor: 1.6"),
    "a rotor, for long": (2.0, "rotor_weak, rotor: rear_right, left: 0.45, for: 8 s"),
    "most of a rotor": (1.5, "rotor_weak, rotor: front_left, left: 0.15"),
    "a rotor, which recovers": (1.0, "rotor_weak, rotor: rear_right, left: 0.4, for: 0.9 s"),
}


@pytest.mark.parametrize(
    ("burden", "target"),
    [
        pytest.param(burden, target, marks=[] if i % 3 == k else [pytest.mark.slow])
        for i, burden in enumerate(BURDENS)
        for k, target in enumerate(("sim", "emulated_px4", "emulated_ardupilot"))
    ],
)
def test_it_stays_in_the_air(burden: str, target: str, tmp_path: Path) -> None:
    height, fault = BURDENS[burden]
    plan = compiled(
        tmp_path / "burdened.yaml",
        MISSION.format(height=height, fault=fault),
        target=target,
        warns=True,
    )
    told: list[str] = []
    run = fly(plan, RunRequest(out=tmp_path / "run"), (lambda event: told.append(event.name),))
    findings = judge(plan, run.folder, run.summary).findings
    if burden == "most of a rotor":  # it spins, is landed for that, hard, and may bounce
        assert all(found.kind == "hard" and found.value < 3.0 for found in findings)
    else:
        assert findings == ()
        assert "collided" not in told
    assert run.summary["vehicles"]["a"]["final"] == "ground"
