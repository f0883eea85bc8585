"""What is told of cameras, and that the reason of a change says it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy
import pytest
from plans import part, state, vehicle
from toolchain import MISSIONS, compiled, flight_of

from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS, Estimate, Event, Frame
from kybflow.dsl.plan import EstimatorPlan, PartPlan
from kybflow.parts import Estimator
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.cameras import CameraMonitor, EstimateHistory
from kybflow.world.cameras import Camera, Lens

LENS = Lens(40, 30, 40.0, 40.0, 20.0, 15.0)
CAMERAS = {name: Camera(name, LENS, (0.0, 0.0, 0.0), rate=20.0) for name in ("down", "rear")}
REST = (0.0, 0.0, 0.0)
STEP = NS // 20


@dataclass(frozen=True)
class NoParams:
    pass


class Seeing(Estimator[NoParams]):
    needs = frozenset({Frame})

    def update(self, measurements: Any, now: Any) -> Estimate | None:
        return None


def plan(estimator: PartPlan) -> Any:
    states = [state("wait", part("behaviors", "wait_on_ground"))]
    estimators = (EstimatorPlan(estimator, recover_after=1.0),)
    return vehicle("a", states, estimators=estimators, cameras=CAMERAS)


SEEING = PartPlan("seeing", Seeing, NoParams(), "estimators.seeing", "m.yaml:4")


class Watch:
    """A vehicle at rest in the air whose camera `down` gives `image`; an estimator finds itself at
    `seen` in it."""

    def __init__(self, estimator: PartPlan = SEEING) -> None:
        self.told: list[Event] = []
        self.fleet = EstimateHistory()
        events = Events((self.told.append,))
        self.watched = CameraMonitor(plan(estimator), self.fleet, events)
        self.one = SimpleNamespace(name="seeing", part=SimpleNamespace(sighting=None))
        self.k = self.passed = 0

    def fly(self, steps: int, image: Any = None, seen: Any = REST, cameras: Any = ("down",)) -> Any:
        for _ in range(steps):
            self.k += 1
            now = self.k * STEP
            frames = [Frame(now, c, self.noise() if image is None else image) for c in cameras]
            self.passed += len(self.watched.measured(frames, now, True))
            if frames:
                self.one.part.sighting = SimpleNamespace(frames=frames, located=self.located(seen))
            self.watched.judge((self.one,), True)  # type: ignore[arg-type]
            self.fleet.note("a", Estimate(now, REST, REST, LEVEL, REST, "b", 0.0, 0.01))
        return [event.name for event in self.told]

    def noise(self) -> Any:
        return numpy.random.default_rng(self.k).integers(0, 255, (30, 40), numpy.uint8)

    def located(self, seen: Any) -> Any:
        view = SimpleNamespace(camera=CAMERAS["down"], tags=(1,))
        covariance = numpy.diag([1e-6] * 6)
        if seen is None:
            return None
        return SimpleNamespace(position=seen, covariance=covariance, views=(view,))


def test_one_that_freezes_is_told_by_the_line_of_the_estimator_and_what_it_shows_is_not() -> None:
    watch = Watch()
    watch.fly(5)
    kept = watch.noise()
    assert watch.fly(20, kept, seen=(3.0, 0.0, 0.0)) == ["camera_froze"]
    (froze,) = watch.told
    assert (froze.vehicle, froze.at, froze.fields["camera"]) == ("a", "m.yaml:4", "down")
    assert froze.fields["value"] > froze.fields["bound"] == 0.1  # type: ignore[operator]
    assert watch.watched.trouble == "the camera `down` froze"
    passed = watch.passed
    assert passed <= 5 + 3
    watch.fly(5, kept)
    assert watch.passed == passed
    assert watch.fly(5)[1:] == ["camera_recovered"]
    assert watch.passed > passed
    assert watch.watched.trouble is None


def test_one_that_falls_silent_is_told() -> None:
    watch = Watch()
    watch.fly(5, cameras=("down", "rear"))
    assert watch.fly(5, cameras=("down",)) == ["camera_lost"]
    assert watch.told[0].fields["camera"] == "rear"
    assert watch.watched.trouble == "the camera `rear` gives no frames"


def test_what_a_camera_shows_elsewhere_is_told() -> None:
    watch = Watch()
    watch.fly(5)
    assert watch.fly(5, seen=(2.0, 0.0, 0.0)) == ["camera_jumped"]
    assert watch.watched.trouble == "what the camera `down` shows jumped by 2.00 m"


def test_and_whose_place_it_is() -> None:
    watch = Watch()
    watch.fly(5)
    for k in range(12):
        watch.fleet.note("b", Estimate(k * STEP, (2.1, 0, 0), REST, LEVEL, REST, "", 0.0, 0.01))
    assert watch.fly(5, seen=(2.0, 0.0, 0.0)) == ["camera_swapped"]
    assert watch.told[0].fields["other"] == "b"
    assert watch.watched.trouble == "the camera `down` shows where `b` is"


def test_tags_that_are_not_found_are_told() -> None:
    watch = Watch()
    watch.fly(5)
    assert watch.fly(5, seen=None) == ["tags_lost"]
    assert watch.watched.trouble == "no tag is found in the frames"
    assert watch.watched.is_blind
    assert watch.fly(1) == ["tags_lost", "tags_found"]


def test_an_estimator_that_makes_nothing_new_of_frames_says_nothing() -> None:
    """It was killed, or waits: that is no fault of the camera's."""
    watch = Watch()
    watch.fly(5)
    for watch.k in range(6, 30):
        now = watch.k * STEP
        watch.watched.measured([Frame(now, "down", watch.noise())], now, True)
        watch.watched.judge((watch.one,), True)  # type: ignore[arg-type]
    assert watch.told == []


def test_nobody_misses_frames_that_nobody_asks_for() -> None:
    assert Watch().watched.is_asked
    assert not Watch(part("estimators", "mocap")).watched.is_asked


MISSION = MISSIONS / "courier.yaml"


@pytest.mark.slow
def test_the_couriers_camera_is_told_before_its_estimator_changes(tmp_path: Path) -> None:
    pytest.importorskip("cv2")

    text = MISSION.read_text(encoding="utf-8").replace("library/", "kybflow/")
    when = "when: courier in out and elapsed > 2 s, on: courier"
    begin, _ = text.split("expect:")
    plan = compiled(
        tmp_path / "m.yaml", f"{begin}faults:\n  - {{{when}, inject: camera_frozen, for: 1.5 s}}\n"
    )
    flown, told = flight_of(plan, tmp_path / "run")
    assert flown.summary["outcome"] == "succeeded"
    names = [e.name for e in told if e.name.startswith(("camera_", "tags_", "estimator_"))]
    assert names == [
        "estimator_changed", "camera_froze", "estimator_changed", "camera_recovered",
        "estimator_changed",
    ]  # fmt: skip
    changed = [e for e in told if e.name == "estimator_changed"]
    assert str(changed[1].fields["reason"]).endswith("; the camera `down` froze")
