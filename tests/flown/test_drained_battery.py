"""A vehicle keeps its height while its battery drains, by whoever's controller it flies."""

from pathlib import Path

import pytest
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

MISSION = """
kybflow: 1
mission: drained
vehicles:
  nano:
    airframe:
      {mass: 0.230 kg, diameter: 0.19 m, inertia: [0.00045, 0.00045, 0.00080], thrust: 1.3 N,
       torque_ratio: 1.0 cm, rotor_time: 30 ms, drag: 0.35 1/s, endurance: 1 min}
    start: {at: [0, 0, 0]}
    behaviors:
      up:    {do: take_off, height: 1 m, then: drain, within: 15 s}
      drain: {do: hover, for_time: 25 s, then: low}
      low:   {do: hover, for_time: 5 s, then: down}
      down:  {do: land}
expect:
  - min(nano.battery.remaining in low) < 47 %
  - max(nano.position_error in low) < 6 cm
"""


@pytest.mark.parametrize(
    "target",
    [
        "sim",
        pytest.param("emulated_px4", marks=pytest.mark.thorough),
        pytest.param("emulated_ardupilot", marks=pytest.mark.slow),
    ],
)
def test_it_keeps_its_height_at_half_of_its_battery(target: str, tmp_path: Path):
    plan = compiled(tmp_path / "drained.yaml", MISSION, target=target, warns=True)
    flown = fly(plan, RunRequest(out=tmp_path / "run"))
    assert [e for e in flown.summary["expectations"] if not e["held"]] == []
    assert flown.summary["outcome"] == "succeeded"
