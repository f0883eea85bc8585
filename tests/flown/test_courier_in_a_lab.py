"""A courier on printed tags alone, where lens, mount, map and stamps are not what is believed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("cv2")

from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

MISSION = """
kybflow: 1
mission: courier_in_a_lab
import: {lab: kybflow/courier, rooms: kybflow/worlds}
world: {like: rooms.tag_floor, points: {east: null, north: null, mark: [1.3, 0, 0]}}
vehicles:
  courier:
    like: lab.courier
    start: {at: world.points.pad}
    behaviors:
      up:   {do: take_off, height: 1.2 m, then: out, within: 15 s}
      out:  {do: fly_to, position: world.points.south, speed: 60 cm/s, then: drop, failed: here, within: 20 s}
      drop: {do: release_payload, then: back, failed: back, within: 10 s}
      back: {do: fly_to, position: world.points.over_pad, speed: 60 cm/s, then: down, failed: here, within: 20 s}
      down: {do: land, position: world.points.pad, failed: here}
      here: {do: land}
expect:
  - finally distance(courier.payload to world.points.mark) < 8 cm
  - finally distance(courier to world.points.pad) < 5 cm
  - max(courier.position_error in out) < 10 cm
  - finally courier in landed
"""  # noqa: E501
REFUSED = {"position_refused", "estimator_lost", "estimate_lost", "camera_jumped"}


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.slow) for s in (2, 3, 4))])
def test_it_brings_its_parcel_and_comes_back_and_refuses_no_frame(
    seed: int, tmp_path: Path
) -> None:
    plan = compiled(tmp_path / "courier.yaml", MISSION)
    flown = fly(plan, RunRequest(seed=seed, out=tmp_path / "run"))
    assert flown.summary["outcome"] == "succeeded", flown.summary["expectations"]
    lines = (tmp_path / "run" / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert not REFUSED & {json.loads(line)["event"] for line in lines}
