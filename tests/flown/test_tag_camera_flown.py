"""A vehicle that flies on `tag_camera` alone, late frames of a rolling shutter, does not sway in
still air, where lens, mount and map are exact. In a lab it does (docs/estimators.md)."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("cv2")

from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

MISSION = """kybflow: 1
mission: alone
import: {std: kybflow/airframes, rooms: kybflow/worlds}
world: {like: rooms.tag_floor, points: {over_pad: null, south: null, east: null, north: null, mark: null}}
airframes:
  courier: {like: std.courier_quad, cameras: {down: {width: 320, height: 240, rate: 30 Hz, row_time: 0.06 ms}}}
vehicles:
  courier:
    airframe: courier
    start: {at: world.points.pad}
    estimators: [{use: tag_camera, healthy: age < 250 ms and spread < 5 cm}]
    behaviors:
      up:   {do: take_off, height: 1.2 m, then: wait}
      wait: {do: hover, for_time: 6 s, then: down}
      down: {do: land, position: world.points.pad}
targets:
  sim: {courier: {driver: {use: sim, calm: true}, sensors: {tag_camera: {use: simulated_camera, row_time: 0.06 ms}}}}
expect:
  - max(courier.position_error in wait) < 3 cm
  - max(courier.velocity_error in wait) < 4 cm/s
  - finally distance(courier to world.points.pad) < 10 cm
  - finally courier in landed
"""  # noqa: E501


@pytest.mark.slow
def test_it_hovers_and_lands_on_the_pad(tmp_path: Path) -> None:
    plan = compiled(tmp_path / "alone.yaml", MISSION)
    flown = fly(plan, RunRequest(seed=0, out=tmp_path / "run"))
    broken = [(e["text"], e["value"]) for e in flown.summary["expectations"] if not e["held"]]
    assert broken == []
    assert flown.summary["outcome"] == "succeeded"
