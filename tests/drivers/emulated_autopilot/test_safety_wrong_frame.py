"""An autopilot whose poses are in a wrong frame is landed by kybflow, blind: its own land mode
would follow the filter that took the poses."""

from __future__ import annotations

from dataclasses import replace
from math import hypot
from pathlib import Path

import pytest
from short_flights import NoParams
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import NS, Alarm, Event, Imu, Reaction, Tick
from kybflow.dsl.plan import PartPlan
from kybflow.parts import Supervisor
from kybflow.runtime import engine as engine_module
from kybflow.runtime.estimators.mocap import Mocap

pytest.importorskip("pymavlink.dialects.v20.all", reason="pymavlink is not installed")

MISSION = """
kybflow: 1
mission: wrong_frame
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}}}
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up: {{do: take_off, height: 1 m, then: still}}
      still: {{do: hover, for_time: 3 s, then: down}}
      down: {{do: land}}
targets:
  flown: {{all: {{driver: {{use: emulated_autopilot, autopilot: {autopilot}}}}}}}
faults:
- {{at: 0 s, on: a, inject: mocap_frame, {rule}}}
"""
thorough = pytest.mark.thorough
SCALED, MIRRORED = "factor: 0.001", "mirrored: y"


@pytest.mark.parametrize(
    ("autopilot", "rule", "highest"),
    [
        ("px4", MIRRORED, 1.1),
        ("ardupilot", SCALED, 0.3),
        pytest.param("px4", SCALED, 0.3, marks=thorough),
        pytest.param("ardupilot", MIRRORED, 1.1, marks=thorough),
    ],
)
def test_it_comes_down_near_its_start_and_gently(
    autopilot: str, rule: str, highest: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine_module, "_OBSERVED_EVERY", 1)
    text = MISSION.format(autopilot=autopilot, rule=rule)
    plan = compiled(tmp_path / "wrong.yaml", text, target="flown", warns=True)
    most, told, poses, felt = [0.0, 0.0, 0.0], [], [], set()

    def look(engine):
        one = engine.vehicles[0]
        _, sent = one.knowledge.link_in._link._vision.newest or (None, 0)
        poses.append(sent / NS)
        if engine.flying and one.state == "land_blind":
            felt.add(one.knowledge.resting.specific_force)
        if one.truth is not None:
            x, y, z = one.truth.position
            now = z, hypot(x, y), -one.truth.velocity[2]
            most[:] = (max(pair) for pair in zip(most, now, strict=True))

    run = fly(plan, RunRequest(out=tmp_path / "run"), (told.append,), (look,))
    [at_rest] = felt
    assert at_rest == pytest.approx(GRAVITY, abs=0.2), "not while it was armed and climbed"
    [alarm] = [event for event in told if event.name == "mocap_frame_wrong"]
    height, side, down = most
    assert height <= highest
    assert side <= 1.0
    assert down < 1.5
    names = {event.name for event in told}
    assert not names & {"land_mode_started", "landed_hard", "collided", "control_lost"}
    assert "observer_failed" not in names
    assert run.summary["vehicles"]["a"]["final"] == "ground"
    assert alarm.fields["reason"] in run.summary["reason"]
    assert any(-0.1 < sent - alarm.time / NS <= 0.0 for sent in poses)
    assert not any(0.02 < sent - alarm.time / NS < 1.0 for sent in poses)


class Hasty(Supervisor[NoParams]):
    """Requests a blind landing 20 cm up, before any frame can be judged."""

    events = ("hasty",)

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if tick.estimate is None or tick.estimate.position[2] < 0.2:
            return None
        return Alarm("hasty", Reaction.LAND_BLIND, "20 cm up")


def test_a_land_mode_that_turns_out_to_follow_wrong_poses_is_left(tmp_path: Path) -> None:
    text = MISSION.format(autopilot="px4", rule=MIRRORED)
    plan = compiled(tmp_path / "wrong.yaml", text, target="flown", warns=True)
    [own] = plan.vehicles
    hasty = PartPlan("hasty", Hasty, NoParams(), "supervisors.hasty")
    plan = replace(plan, vehicles=(own.but(supervisors=(*own.supervisors, hasty)),))
    told: list[Event] = []
    run = fly(plan, RunRequest(seed=1, out=tmp_path / "run"), (told.append,))
    names = [event.name for event in told]
    begun, found = names.index("land_mode_started"), names.index("mocap_frame_wrong")
    assert names.index("hasty") < begun < found
    entered = [e for e in told[found:] if e.fields.get("behavior") == "land_blind"]
    assert "behavior_started" in {event.name for event in entered}
    assert names.count("land_mode_started") == 1
    assert told[found].fields["reason"] in run.summary["reason"]
    assert run.summary["vehicles"]["a"]["final"] == "ground"
    assert not {"landed_hard", "collided"} & set(names)


def test_samples_that_only_the_check_needs_are_not_shown_to_estimators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They would correct poses by samples that come fast for the first seconds only."""
    quick: list[float] = []
    update = Mocap.update

    def watched(self, measurements, now):
        quick.extend(now / NS for m in measurements if isinstance(m, Imu) and m.dt < 0.02)
        return update(self, measurements, now)

    monkeypatch.setattr(Mocap, "update", watched)
    text = MISSION.format(autopilot="ardupilot", rule="factor: 1.0")
    plan = compiled(tmp_path / "right.yaml", text, target="flown", warns=True)
    rates: list[float] = []

    def look(engine):
        rates.append(engine.vehicles[0].knowledge.rate(Imu))

    told = []
    fly(replace(plan, faults=()), RunRequest(out=tmp_path / "run"), (told.append,), (look,))
    assert max(rates) > 60.0
    assert quick == []
    assert "observer_failed" not in {event.name for event in told}
