"""A take-off in wind stays over its place, by whoever's controller it flies."""

from pathlib import Path

import pytest
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

MISSION = """
kybflow: 1
mission: windy
import: {{std: kybflow/airframes}}
vehicles:
  nano:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up:   {{do: take_off, height: 1 m, then: hold, within: 15 s}}
      hold: {{do: hover, for_time: 3 s, then: down}}
      down: {{do: land}}
targets:
  windy:
    all:
      driver: {{use: emulated_autopilot, autopilot: {autopilot}, calm: true, wind: [0, -5, 0]}}
expect:
  - max(nano.position_error in up) < 50 cm
  - max(nano.position_error in hold) < 20 cm
  - finally distance(nano to nano.start) < 2 cm
"""


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_it_is_not_blown_away(autopilot: str, tmp_path: Path):
    """The wind takes 1.75 m/s^2, more than half of what 20 degrees of tilt can give. An autopilot
    that climbs by itself drops its own integral when it is handed over: the tracker begins anew."""
    plan = compiled(
        tmp_path / "windy.yaml", MISSION.format(autopilot=autopilot), target="windy", warns=True
    )
    flown = fly(plan, RunRequest(out=tmp_path / "run"))
    assert flown.summary["outcome"] == "succeeded", flown.summary["expectations"]
