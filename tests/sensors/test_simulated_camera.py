"""When frames are taken, when they arrive, and of what moment they are."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import pytest

pytest.importorskip("cv2")

import numpy
from part_bench import SITE

from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL, ZERO, add
from kybflow.core.signals import NS, Frame, Truth
from kybflow.parts import ActiveFaults, Effect, Link
from kybflow.parts.catalog import load_catalog
from kybflow.sensors.simulated_camera import SimulatedCamera, SimulatedCameraParams
from kybflow.vision.rendering.drawing import Room
from kybflow.world.cameras import SOUND, Camera, Lens, Weakness
from kybflow.world.shapes import Sphere
from kybflow.world.tags import Tag, TagMap
from kybflow.world.vehicle_context import LEGS, Parcel, VehicleContext

LENS = Lens(160, 120, 120.0, 120.0, 79.5, 59.5)
DOWN = Camera("down", LENS, ZERO, rate=30.0)
TAGS = TagMap([Tag("36h11", 7, 0.3, (0.0, 0.0, 0.0), LEVEL)])
AWAY = Truth((0.1, 0.2, 1.5), ZERO, LEVEL, ZERO)
"""Where another vehicle is."""
TICK = 4_000_000
SPEED = 0.5
CLEAN = SimulatedCameraParams(
    latency=0.05, exposure=0.0, row_time=0.0, read_noise=0.0, shot_noise=0.0
)


def body_at(time: int) -> Truth:
    return Truth((SPEED * (time / NS - 0.3), 0.0, 1.0), (SPEED, 0.0, 0.0), LEVEL, ZERO)


class Passing(Link):
    """The link of a vehicle that flies east at SPEED, 1 m high; it passes over the origin at
    0.3 s."""

    def __init__(self) -> None:
        self.now = 0
        self.faults = ActiveFaults("nano")
        self.swapped = False

    def read(self, now: int) -> tuple[()]:
        return ()

    def send(self, command: Any, now: int) -> None: ...

    def truth(self) -> Truth:
        return body_at(self.now)

    def view(self) -> Truth | None:
        return AWAY if self.swapped else self.truth()


class Hardware(Passing):
    def truth(self) -> None:
        return None


def context(*cameras: Camera) -> VehicleContext:
    return SITE._replace(tags=TAGS, cameras={camera.name: camera for camera in cameras})


def opened(
    link: Link, *cameras: Camera, params: SimulatedCameraParams = CLEAN, seed: int = 1
) -> Any:
    return SimulatedCamera.open(params, context(*cameras), link, random.Random(seed))


def frames_of(link: Passing, until: int, **params: Any) -> list[Frame]:
    """The frames of one camera until then."""
    return [frame for _, frame in fly(opened(link, DOWN, **params), link, until)]


def fly(stream: Any, link: Passing, until: int, since: int = 0) -> list[tuple[int, Frame]]:
    """What arrives, and when."""
    arrived = []
    for now in range(since, until, TICK):
        link.now = now
        arrived += [(now, frame) for frame in stream.read(now)]
    return arrived


def test_frames_have_the_exact_times_of_their_rate_and_arrive_late() -> None:
    link = Passing()
    arrived = fly(opened(link, DOWN), link, NS)
    assert [frame.time for _, frame in arrived] == [round(i * NS / 30) for i in range(29)]
    for now, frame in arrived:
        assert 0 <= now - frame.time - 50_000_000 < TICK
        assert frame.camera == "down"
        assert frame.image.shape == (120, 160)
        assert frame.image.dtype == numpy.uint8


def test_a_frame_shows_the_exact_moment_between_ticks() -> None:
    room = Room(TAGS, CLEAN, random.Random(1).getrandbits(64))
    frames = frames_of(Passing(), NS // 2)
    for frame in frames:
        off = room.draw(DOWN, body_at(frame.time)).astype(int) - frame.image
        assert numpy.abs(off).max() <= 1  # rounding
    assert (frames[8].image != frames[9].image).any()


def test_each_camera_has_its_rate_and_what_arrives_is_in_order() -> None:
    link = Passing()
    other = DOWN._replace(name="rear", position=(-0.1, 0.0, 0.0), rate=50.0)
    arrived = fly(opened(link, DOWN, other), link, NS)
    times = [frame.time for _, frame in arrived]
    assert times == sorted(times)
    names = [frame.camera for _, frame in arrived]
    assert (names.count("down"), names.count("rear")) == (29, 48)


def test_the_same_seed_gives_the_same_frames() -> None:
    def images(seed: int) -> list[bytes]:
        params = SimulatedCameraParams(covered=0.5)
        return [f.image.tobytes() for f in frames_of(Passing(), NS // 5, params=params, seed=seed)]

    assert images(1) == images(1)
    assert images(1) != images(2)


def test_a_frame_is_drawn_when_it_arrives_and_not_before(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    draw = Room.draw
    monkeypatch.setattr(Room, "draw", lambda *a: drawn.append(1) or draw(*a))
    link = Passing()
    stream = opened(link, DOWN)
    assert fly(stream, link, 48_000_000) == []
    assert drawn == []
    assert len(fly(stream, link, 60_000_000, 48_000_000)) == len(drawn) == 1


def test_one_that_is_opened_late_takes_frames_from_then_on() -> None:
    link = Passing()
    arrived = fly(opened(link, DOWN), link, 1_200_000_000, NS + TICK)
    assert arrived[0][1].time == round(31 * NS / 30)


def test_what_is_wrong_with_a_camera_counts_when_the_frame_is_taken() -> None:
    link = Passing()
    stream = opened(link, DOWN)
    fly(stream, link, 302_000_000)
    link.faults.begin(Effect(camera=Weakness(dark=True)), 0)
    later = fly(stream, link, 424_000_000, 304_000_000)
    bright = {frame.time: frame.image.max() > 0 for _, frame in later}
    assert len(bright) == 4
    assert all(lit == (time < 302_000_000) for time, lit in bright.items())
    assert len(set(bright.values())) == 2


def seen_at(at: Truth, weakness: Weakness = SOUND) -> Any:
    """What the camera sees there."""
    return Room(TAGS, CLEAN, random.Random(1).getrandbits(64)).draw(DOWN, at, weakness).astype(int)


def broken(effect: Effect) -> list[Frame]:
    """The frames of a flight past the tag, the effect at work from the first one on."""
    link = Passing()
    link.faults.begin(effect, 0)
    link.swapped = link.faults.view != "nano"
    return frames_of(link, NS // 2)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "params", "expected"),
    [
        ("camera_dark", {}, lambda t: seen_at(body_at(t), Weakness(dark=True))),
        ("camera_blur", {"pixels": 4.0}, lambda t: seen_at(body_at(t), Weakness(blur=4.0))),
        ("tags_covered", {"share": 1.0}, lambda t: seen_at(body_at(t), Weakness(covered=1.0))),
        ("camera_swapped", {"other": "b"}, lambda t: seen_at(AWAY)),
        ("camera_shifted", {"offset": (-0.2, 0.1, 0.0)},
         lambda t: seen_at(body_at(t)._replace(position=add(body_at(t).position, (-0.2, 0.1, 0))))),
    ],
)  # fmt: skip
def test_a_fault_of_a_camera_is_in_its_frames(name: str, params: Any, expected: Any) -> None:
    spec = load_catalog().get("faults", name)
    fault = spec.cls(spec.params(**params), random.Random(1))
    frame = broken(fault.effects("nano")["nano"])[9]
    assert numpy.abs(expected(frame.time) - frame.image).max() <= 1  # rounding
    assert numpy.abs(seen_at(body_at(frame.time)) - frame.image).max() > 50


def test_frames_pass_the_filters_of_the_rig() -> None:
    assert broken(Effect(filter=lambda frame: None)) == []
    later = broken(Effect(filter=lambda frame: frame._replace(camera="else")))
    assert {frame.camera for frame in later} == {"else"}


def test_it_says_what_it_lacks() -> None:
    with pytest.raises(DriverError, match="the vehicle `nano` has no camera to take frames with"):
        opened(Passing())
    blind = opened(Hardware(), DOWN)
    assert blind.read(0) == ()
    assert "use a simulated vehicle" in (blind.trouble() or "")
    assert SimulatedCamera.provides == {Frame}
    assert SimulatedCamera.simulated


PARCEL = Parcel(mass=0.2, size=0.2)


class Carrying(Passing):
    """The link of a vehicle with a parcel, which it lets go at `released`: from then on it lies on
    the floor at the origin."""

    def __init__(self, released: float = 9.0) -> None:
        super().__init__()
        self.released = released

    def truth(self) -> Truth:
        body = super().truth()
        centre = 0.5 * PARCEL.size - LEGS
        x, y, z = body.position
        aboard = (x, y, z + centre)
        lies = self.now / NS >= self.released
        return body._replace(payload=(0.0, 0.0, centre) if lies else aboard)


def test_a_parcel_is_seen_once_it_is_released_and_hides_the_tag_that_it_lies_on() -> None:
    def images(link: Passing, **more: Any) -> list[Frame]:
        place = context(DOWN)._replace(**more)
        stream = SimulatedCamera.open(CLEAN, place, link, random.Random(1))
        return [frame for _, frame in fly(stream, link, NS // 2)]

    without, aboard = images(Passing()), images(Carrying(), payload=PARCEL)
    released = images(Carrying(released=0.2), payload=PARCEL)
    assert all((a.image == b.image).all() for a, b in zip(without, aboard, strict=True))
    changed = [(a.image != b.image).sum() for a, b in zip(aboard, released, strict=True)]
    assert changed[:6] == [0] * 6
    # its upper face is 80 cm below the lens of 120 pixels, and has a rim of 3 blurred pixels
    side = 120 * PARCEL.size / 0.8
    assert all(side**2 < count < (side + 6) ** 2 for count in changed[6:])


def test_the_worlds_obstacles_are_drawn() -> None:
    ball = context(DOWN)._replace(obstacles={"ball": Sphere((0.0, 0.0, 0.1), 0.1)})
    images = []
    for place in (ball, context(DOWN)):
        link = Passing()
        stream = SimulatedCamera.open(CLEAN, place, link, random.Random(1))
        images.append([frame.image for _, frame in fly(stream, link, NS // 2)][9])
    seen, free = images
    assert 0.01 < (seen != free).mean() < 0.05


LAB = replace(CLEAN, calm=False)


class InALab(Passing):
    is_calm = False


@pytest.mark.parametrize(("link", "params", "is_exact"), [
    (Passing(), CLEAN, True),
    (Passing(), LAB, False),
    (InALab(), CLEAN, False),
    (InALab(), replace(CLEAN, calm=True), True),
])  # fmt: skip
def test_a_camera_is_as_perfect_as_the_world_of_its_vehicle(
    link: Passing, params: SimulatedCameraParams, is_exact: bool
) -> None:
    """Unless its parameter says otherwise; what is exact comes with the stamp and the image of the
    calm world, what is not with neither."""
    calm, seen = frames_of(Passing(), NS // 2), frames_of(link, NS // 2, params=params)
    assert len(seen) == len(calm)
    assert all((a.time == b.time) is is_exact for a, b in zip(seen[1:], calm[1:], strict=True))
    alike = [(a.image == b.image).all() for a, b in zip(seen, calm, strict=True)]
    assert all(alike) is is_exact


def test_nobody_who_locates_is_told_what_is_wrong_in_a_lab() -> None:
    """The sensor changes neither the cameras nor the tags of the vehicle's context."""
    site, link = context(DOWN), InALab()
    opened_in = SimulatedCamera.open(CLEAN, site, link, random.Random(1))
    fly(opened_in, link, NS // 4)
    assert site == context(DOWN)


def test_stamps_in_a_lab_are_late_by_the_same_for_a_whole_flight() -> None:
    late = [f.time - round(i * NS / 30) for i, f in enumerate(frames_of(InALab(), NS))][1:]
    assert len(set(late)) == 1
    assert late[0] != 0
    assert abs(late[0]) < 15_000_000
