"""What cameras show is told apart by the poses that were found, and by what was believed then."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

import numpy
import pytest

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import LEVEL, Vec3
from kybflow.core.signals import NS, Estimate, Frame, Time
from kybflow.parts.events import CameraJumped, TagsFound, TagsLost
from kybflow.runtime.monitoring.bodies import AGREEING_POSES
from kybflow.runtime.monitoring.cameras import EstimateHistory, Sightings
from kybflow.world.cameras import Camera, Lens

CAMERA = Camera("down", Lens(4, 4, 4.0, 4.0, 2.0, 2.0), (0.0, 0.0, 0.0), rate=20.0)
STEP = NS // 20
SPREAD = 0.005
REST = (0.0, 0.0, 0.0)
Place = Callable[[int], Vec3 | None]


def at(k: int) -> Vec3:
    """A vehicle that flies east at 1 m/s."""
    return (0.05 * k, 0.0, 1.2)


def shifted(k: int, first: int, last: int = 99) -> Vec3:
    x, y, z = at(k)
    return (x + 1.0, y, z) if first <= k < last else (x, y, z)


def sighting(time: Time, position: Vec3 | None, camera: str = "down") -> Any:
    located = None
    if position is not None:
        view = SimpleNamespace(camera=SimpleNamespace(name=camera), tags=(1, 2))
        covariance = numpy.diag([1e-6] * 6)
        located = SimpleNamespace(position=position, covariance=covariance, views=(view,))
    return SimpleNamespace(frames=[Frame(time, camera, None)], located=located)


def believe(fleet: EstimateHistory, vehicle: str, position: Vec3, time: Time) -> None:
    fleet.note(vehicle, Estimate(time, position, REST, LEVEL, REST, "fusion", 0.0, SPREAD))


class Flight:
    """`believed` is where the vehicle believes to be at a frame's time, `seen` where its camera has
    it."""

    def __init__(self) -> None:
        self.fleet = EstimateHistory()
        self.sights = Sightings("a", {"down": CAMERA}, self.fleet)

    def fly(
        self, seen: Place, believed: Place = at, steps: Iterable[int] = range(20), air: bool = True
    ) -> list[tuple[int, VehicleEvent]]:
        found = []
        for k in steps:
            where = believed(k)
            if where is not None:
                believe(self.fleet, "a", where, k * STEP)
            judged = self.sights.judge(sighting(k * STEP, seen(k)), air)
            found += [(k, finding) for finding in judged]
        return found


def test_nothing_is_said_of_poses_that_are_where_the_vehicle_is() -> None:
    assert Flight().fly(at) == []


def test_poses_elsewhere_that_go_on_from_there_are_a_jump() -> None:
    flight = Flight()
    ((step, found),) = flight.fly(lambda k: shifted(k, 5))
    assert step == 5 + AGREEING_POSES - 1
    bound = 0.2 + 4.0 * (SPREAD + 1e-3)
    assert found == CameraJumped(
        camera="down", value=pytest.approx(1.0), bound=pytest.approx(bound)
    )
    assert flight.sights.wrong == {"down": found}


def test_one_that_goes_back_to_where_the_vehicle_is_recovers() -> None:
    flight = Flight()
    found = flight.fly(lambda k: shifted(k, 5, 12))
    assert [(k, f.name, f.camera) for k, f in found] == [
        (7, "camera_jumped", "down"), (14, "camera_recovered", "down"),
    ]  # fmt: skip
    assert flight.sights.wrong == {}


def test_so_does_one_that_is_there_again_after_no_pose_was_found() -> None:
    """It goes back while nothing is seen, and so long that it could have flown there."""
    found = Flight().fly(lambda k: None if 9 <= k < 14 else shifted(k, 5, 12))
    assert [(k, f.name) for k, f in found] == [
        (7, "camera_jumped"), (12, "tags_lost"), (14, "tags_found"), (16, "camera_recovered"),
    ]  # fmt: skip


def test_a_single_pose_elsewhere_is_none_nor_are_two() -> None:
    assert Flight().fly(lambda k: shifted(k, 5, 7)) == []


def test_nor_are_poses_that_are_elsewhere_each_time() -> None:
    assert Flight().fly(lambda k: (0.05 * k, (-1.0) ** k, 1.2)) == []


def test_an_estimator_that_follows_it_makes_nothing_well() -> None:
    """It takes the first frame that jumped, which is late; from then on it believes it."""
    found = Flight().fly(lambda k: shifted(k, 5), lambda k: shifted(k, 6))
    assert [(k, f.name) for k, f in found] == [(7, "camera_jumped")]


def test_where_another_vehicle_is_it_is_its_camera() -> None:
    flight = Flight()
    for k in range(20):
        believe(flight.fleet, "b", shifted(k, 0), k * STEP)
        believe(flight.fleet, "c", (5.0, 5.0, 1.0), k * STEP)
    ((_, found),) = flight.fly(lambda k: shifted(k, 5))
    assert (found.name, found.camera, found.other) == ("camera_swapped", "down", "b")


def test_on_the_ground_it_may_be_carried_about() -> None:
    flight = Flight()
    assert flight.fly(lambda k: shifted(k, 5), air=False) == []
    assert flight.sights.wrong == {}


def test_a_vehicle_that_believes_nothing_can_say_nothing() -> None:
    assert Flight().fly(lambda k: shifted(k, 5), lambda k: at(k) if k < 4 else None) == []


def test_frames_without_a_pose_in_the_air_are_told_and_their_end() -> None:
    flight = Flight()
    found = flight.fly(lambda k: None if 5 <= k < 12 else at(k))
    lost, back = found
    assert lost == (8, TagsLost(value=pytest.approx(0.2), bound=0.15))
    assert back == (12, TagsFound())


def test_the_bound_is_that_of_the_fastest_camera() -> None:
    slow = CAMERA._replace(name="slow", rate=2.0)
    sights = Sightings("a", {"slow": slow}, EstimateHistory())
    sights.judge(sighting(0, at(0)), True)
    found = [sights.judge(sighting(k * NS // 2, None), True) for k in range(1, 5)]
    assert found[:2] == [[], []]
    assert found[2] == [TagsLost(value=1.5, bound=1.25)]
    assert found[3] == []


def test_on_the_ground_a_tag_may_be_too_near() -> None:
    flight = Flight()
    assert flight.fly(lambda k: None, air=False) == []
    assert flight.sights.is_blind
    assert flight.fly(at, air=False) == []
    assert not flight.sights.is_blind


def test_two_cameras_are_judged_each_for_itself() -> None:
    """Their frames come in turns; one of them is shifted."""
    fleet = EstimateHistory()
    sights = Sightings("a", {"down": CAMERA, "rear": CAMERA._replace(name="rear")}, fleet)
    found = []
    for k in range(20):
        believe(fleet, "a", at(k), k * STEP)
        found += sights.judge(sighting(k * STEP, shifted(k, 5), "down"), True)
        found += sights.judge(sighting(k * STEP, at(k), "rear"), True)
    assert [(f.name, f.camera) for f in found] == [("camera_jumped", "down")]


def test_what_was_believed_is_known_for_a_moment() -> None:
    fleet = EstimateHistory()
    for k in range(2000):
        believe(fleet, "a", (float(k), 0.0, 0.0), k * NS // 250)
    now = 1999 * NS // 250
    assert fleet.at("a", now - 5 * NS // 250 + 1).position[0] == 1994.0  # type: ignore[union-attr]
    assert fleet.at("a", 0) is None
    assert fleet.at("a", now + NS) is None
    assert fleet.at("b", now) is None


def test_a_camera_that_jumped_recovers_with_another_one() -> None:
    flight = Flight()
    flight.fly(lambda k: shifted(k, 5, 12), steps=range(14))
    assert set(flight.sights.wrong) == {"down"}
    found = []
    for k in range(14, 20):
        believe(flight.fleet, "a", at(k), k * STEP)
        found += flight.sights.judge(sighting(k * STEP, at(k), "down, front"), True)
    assert [(f.name, f.camera) for f in found] == [("camera_recovered", "down")]
    assert flight.sights.wrong == {}
