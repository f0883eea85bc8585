"""A vehicle with a bumper pushes a bar: what conditions and expectations read of the objects. One
that flies into the bar stops before it, or collides."""

from __future__ import annotations

from pathlib import Path

import pytest
from pushed_bar import MISSION
from toolchain import compiled, with_library

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS, Event

MORE = """\
    box: {at: [2, 1, 0.1], size: [30 cm, 30 cm, 30 cm], mass: 2 kg}
    tip: {on: bar, at: [0, 65 cm, 0], size: [6 cm, 10 cm, 6 cm], mass: 10 g}
"""
ASKED = """\
on:
  - {when: bar.angle < -3 deg, do: [{log: turned}]}
  - {when: distance(tip to bar) > 60 cm and tip.x > 55 cm, do: [{log: swung}]}
expect:
  - max(car.position) < 1 m
  - min(bar.yaw in v.go) < -3 deg
  - eventually bar.turn_rate < -2 deg/s
  - min(distance(v to bar.left)) < 40 cm
  - finally box.speed < 1 cm/s
  - max(tip.x) > 58 cm
"""


@pytest.mark.thorough
def test_conditions_read_what_is_seen_and_expectations_the_truth(tmp_path: Path) -> None:
    text = MISSION.replace("vehicles:\n", f"{MORE}vehicles:\n") + ASKED
    plan = compiled(with_library(tmp_path) / "push.yaml", text)
    told: list[Event] = []
    turned: list[float] = []

    def look(engine) -> None:
        if engine.true_objects.states["bar"].q < -0.05236 and not turned:
            turned.append(engine.clock.now / NS)

    flown = fly(plan, RunRequest(seed=1, out=tmp_path / "run"), (told.append,), (look,))
    assert [one["held"] for one in flown.summary["expectations"]] == [True] * 6
    touched = next(e.time for e in told if e.name == "contact_began") / NS
    noticed, swung = (e.time / NS for e in told if e.name == "logged")
    assert touched < turned[0] <= noticed + 0.05
    assert noticed - turned[0] < 0.1
    assert swung - noticed < 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("guarded", [True, False])
def test_what_flies_into_an_object_stops_before_it_or_collides(
    tmp_path: Path, guarded: bool
) -> None:
    text = MISSION[: MISSION.index("      touch:")].replace("touch}", "ram}")
    text += "      ram: {do: fly_to, position: [1.2, 0.45, 1], patience: 3 s, then: down}\n"
    text += "      down: {do: land}\n"
    if not guarded:
        text = text.replace("    behaviors:\n", "    processors: []\n    behaviors:\n")
    plan = compiled(with_library(tmp_path) / "ram.yaml", text, warns=True)
    told: list[Event] = []
    flown = fly(plan, RunRequest(seed=1, out=tmp_path / "run"), (told.append,))
    names = [event.name for event in told]
    assert ("clamp_started" in names) == guarded
    assert ("collided" in names) == ("contact_began" in names) == (not guarded)
    if not guarded:
        assert "`v` ran into `bar`" in flown.summary["reason"]
