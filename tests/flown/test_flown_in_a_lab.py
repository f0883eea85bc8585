"""Two vehicles in the simulator's lab, one of them through the air below the other."""

from pathlib import Path

import pytest
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

MISSION = """
kybflow: 1
mission: below
import: {std: kybflow/airframes}
vehicles:
  mk:
    like: std.mk_quadro
    start: {at: [0, 0, 0]}
    tracker: {use: geometric, observer: 2 Hz}
    behaviors:
      up:   {do: take_off, height: 1.8 m, then: hold, within: 15 s}
      hold: {do: hover, for_time: 12 s, then: down}
      down: {do: land}
  nano:
    like: std.nano_plus
    start: {at: [-1, 0, 0]}
    tracker: {use: geometric, observer: 2 Hz}
    behaviors:
      up:      {do: take_off, height: 70 cm, then: settle, within: 15 s}
      settle:  {do: hover, for_time: 3 s, then: through}
      through: {do: fly_to, position: [1, 0, 0.7], then: hold, within: 15 s}
      hold:    {do: hover, for_time: 3 s, then: down}
      down:    {do: land}
targets:
  lab: {all: {driver: {use: sim, calm: false}}}
expect:
  - max(mk.position_error in hold) < 6 cm
  - max(nano.position_error in settle) < 6 cm
  - max(nano.position_error in through) > 2 cm
  - max(nano.position_error in through) < 15 cm
  - max(nano.position_error in hold) < 3 cm
  - max(nano.state.tilt) < 20 deg
  - finally nano in landed
  - finally mk in landed
"""


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.thorough) for s in (1, 2, 3))]
)
def test_they_take_off_hold_their_places_and_land(seed: int, tmp_path: Path) -> None:
    plan = compiled(tmp_path / "below.yaml", MISSION, target="lab", warns=True)
    flown = fly(plan, RunRequest(seed=seed, out=tmp_path / "run"))
    assert flown.summary["outcome"] == "succeeded", flown.summary["expectations"]
