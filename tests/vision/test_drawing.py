"""The drawn tag floor: true to the projection, as the real detector finds it, with blur and noise
of the sizes that their formulas say."""

from __future__ import annotations

from math import sqrt

import cv2
import numpy
import pytest

from kybflow.core.geometry import LEVEL, ZERO, add, from_euler, integrate, scale
from kybflow.core.signals import Truth
from kybflow.vision.projection import project
from kybflow.vision.rendering.drawing import ImageNoise, Room, blur_lens, motion, streak
from kybflow.vision.rendering.floor import swapped
from kybflow.vision.rendering.shot import Shot, grid
from kybflow.vision.tags import dictionary, pattern
from kybflow.world.cameras import Camera, Lens, Optics, Weakness
from kybflow.world.tags import Tag, TagMap

pytest.importorskip("cv2")


LENS = Lens(640, 480, 460.0, 462.0, 322.0, 238.0, (-0.25, 0.08, 0.001, -0.001, -0.005))
CAMERA = Camera("down", LENS, (0.1, 0.0, -0.05))
PLAIN = CAMERA._replace(lens=LENS._replace(distortion=(0.0,) * 5))
CLEAN = {"read_noise": 0.0, "shot_noise": 0.0, "pattern": 0.0, "floor": 1.0}
SHARP = Optics(exposure=0.0, row_time=0.0, aperture=0.0, **CLEAN)


def floor(count: int = 6, pitch: float = 0.24, size: float = 0.12) -> TagMap:
    """Tags far apart, so that nothing beside a corner draws its refinement away."""
    return TagMap(
        Tag("36h11", i * count + j, size, (j * pitch, -i * pitch, 0.0), LEVEL)
        for i in range(count)
        for j in range(count)
    )


def body(
    x: float = 0.6, y: float = -0.6, z: float = 1.2, roll: float = 0.0, pitch: float = 0.0,
    yaw: float = 0.0, velocity: tuple[float, float, float] = ZERO,
    rates: tuple[float, float, float] = ZERO,
) -> Truth:  # fmt: skip
    return Truth((x, y, z), velocity, from_euler(roll, pitch, yaw), rates)


TURNED = body(roll=0.06, pitch=-0.09, yaw=0.4)
FAST = TURNED._replace(velocity=(1.0, -0.5, 0.2), angular_velocity=(0.5, -0.6, 1.0))


def find(image: numpy.ndarray) -> dict[int, numpy.ndarray]:
    """What OpenCV's own detector finds, corners refined to a fraction of a pixel."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.relativeCornerRefinmentWinSize = 1.0
    parameters.cornerRefinementMinAccuracy = 0.001
    parameters.cornerRefinementMaxIterations = 100
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary("36h11"), parameters).detectMarkers(image)
    return {int(i): c[0] for c, i in zip(corners, [] if ids is None else ids.ravel(), strict=True)}


def draw(tags: TagMap, optics: Optics, at: Truth, camera: Camera = CAMERA, seed: int = 1):
    return Room(tags, optics, seed).draw(camera, at)


def supersampled(tags: TagMap, camera: Camera, at: Truth) -> numpy.ndarray:
    """The same view of a global shutter through a lens without distortion, drawn another way: the
    floor as an image of a pixel a millimetre, warped to eight times the size, and averaged."""
    paper = numpy.full((2000, 2000), 255, numpy.uint8)
    for tag in tags:
        side = round(1000 * tag.size)
        left = 300 + round(1000 * tag.position[0]) - side // 2
        top = 300 - round(1000 * tag.position[1]) - side // 2
        drawn = numpy.where(pattern(tag.family, tag.id) > 0, 255, 20).astype(numpy.uint8)
        drawn = numpy.kron(drawn, numpy.ones((side // len(drawn),) * 2, numpy.uint8))
        paper[top : top + side, left : left + side] = drawn
    places = numpy.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [0, -1, 0]], float)
    pixels, _ = project(camera, at.position, at.attitude, places)
    source = numpy.float32([[300, 300], [1300, 300], [1300, 1300], [300, 1300]]) - 0.5
    warp = cv2.getPerspectiveTransform(source, numpy.float32(8.0 * (pixels + 0.5) - 0.5))
    size = (camera.lens.width, camera.lens.height)
    large = cv2.warpPerspective(paper, warp, (8 * size[0], 8 * size[1]), borderValue=255)
    small = cv2.resize(large, size, interpolation=cv2.INTER_AREA)
    return (0.8 * cv2.GaussianBlur(small, (0, 0), 0.5)).astype(numpy.uint8)


@pytest.mark.thorough
@pytest.mark.parametrize("at", [body(), TURNED, body(z=0.6, yaw=1.0)])
def test_it_is_the_picture_that_averaging_over_each_pixel_gives(at: Truth) -> None:
    drawn = draw(floor(), SHARP, at, PLAIN)
    expected = supersampled(floor(), PLAIN, at)
    assert numpy.abs(drawn.astype(float) - expected).mean() < 0.5
    ours, theirs = find(drawn), find(expected)
    assert ours.keys() == theirs.keys()
    assert len(ours) >= 3
    off = numpy.array([ours[i] - theirs[i] for i in ours])
    assert sqrt((off**2).mean()) < 0.05
    assert numpy.abs(off).max() < 0.15


@pytest.mark.parametrize("at", [body(), TURNED, FAST, FAST._replace(position=(0.6, -0.6, 0.6))])
@pytest.mark.parametrize(
    "optics",
    [
        pytest.param(SHARP, id="sharp", marks=pytest.mark.thorough),
        pytest.param(Optics(**CLEAN), id="real"),
    ],
)
def test_what_the_detector_finds_is_where_the_projection_says(at: Truth, optics: Optics) -> None:
    tags = floor()
    found = find(draw(tags, optics, at))
    shot = Shot(CAMERA, at, optics.row_time)
    assert len(found) >= 3
    expected = {
        i: shot.project(numpy.array(tag.corners()))[0]
        for i in found
        if (tag := tags.get("36h11", i))
    }
    off = numpy.array([found[i] - expected[i] for i in found])
    # its refinement draws each corner 0.1 to 0.15 pixels into the tag, in any picture
    inward = numpy.array([c.mean(axis=0) - c for c in expected.values()])
    inward /= numpy.linalg.norm(inward, axis=2)[..., None]
    drawn_in = (off * inward).sum(axis=2).mean()
    assert 0.08 < drawn_in < 0.22
    assert sqrt(((off - drawn_in * inward) ** 2).mean()) < 0.15
    assert numpy.abs(off.mean(axis=1)).max() < 0.15
    assert numpy.abs(off.mean(axis=(0, 1))).max() < 0.04


def test_tags_of_any_attitude_and_height_are_drawn_where_they_are() -> None:
    tags = TagMap(
        [
            Tag("36h11", 1, 0.2, (0.6, -0.6, 0.3), from_euler(0.3, 0.2, 0.5)),
            Tag("36h11", 2, 0.2, (0.95, -0.6, 0.0), from_euler(-0.3, 0.2, 0.5)),
            Tag("36h11", 3, 0.15, (0.4, -0.9, 0.0), LEVEL),
            Tag("36h11", 4, 0.15, (0.7, -0.2, 0.4), from_euler(3.1, 0.0, 0.0)),
        ]
    )
    found = find(draw(tags, SHARP, body()))
    assert found.keys() == {1, 2, 3}  # the fourth shows its back
    for i, corners in found.items():
        at = body()
        corners_there = numpy.array(tags.get("36h11", i).corners())
        expected, _ = project(CAMERA, at.position, at.attitude, corners_there)
        assert corners.mean(axis=0) == pytest.approx(expected.mean(axis=0), abs=0.1)


def test_a_near_tag_hides_the_one_below() -> None:
    low = Tag("36h11", 1, 0.2, (0.7, -0.6, 0.1), LEVEL)
    high = Tag("36h11", 2, 0.2, (0.7, -0.6, 0.4), LEVEL)
    assert find(draw(TagMap([low, high]), SHARP, body())).keys() == {2}
    assert find(draw(TagMap([high, low]), SHARP, body())).keys() == {2}
    assert find(draw(TagMap([low]), SHARP, body())).keys() == {1}


def test_a_rolling_shutter_shears_by_the_speed_and_the_row_time() -> None:
    at = body(velocity=(0.0, 1.0, 0.0))
    still = find(draw(floor(), SHARP, at, PLAIN))
    rolling = Optics(exposure=0, row_time=4e-5, aperture=0, **CLEAN)
    sheared = find(draw(floor(), rolling, at, PLAIN))
    both = still.keys() & sheared.keys()
    assert len(both) >= 15
    for i in both:
        u, v = sheared[i].mean(axis=0) - still[i].mean(axis=0)
        late = (sheared[i].mean(axis=0)[1] - 239.5) * 4e-5
        # the body goes left, so that what it sees goes right; the lens is 1.15 m above
        assert (u, v) == pytest.approx((460.0 * late / 1.15, 0.0), abs=0.05)


@pytest.mark.parametrize(
    "at",
    [
        pytest.param(body(velocity=(0.5, 0.8, 0.0)), marks=pytest.mark.thorough, id="even"),
        pytest.param(body(rates=(0.0, 0.0, 3.0)), id="turning"),
        pytest.param(body(z=0.3, velocity=(0, 0, 1.0)), marks=pytest.mark.thorough, id="climbing"),
    ],
)
def test_motion_blur_is_the_mean_over_the_exposure(at: Truth) -> None:
    exposure, count = 0.01, 21
    room, mean = Room(floor(), SHARP, 1), numpy.zeros((480, 640))
    for i in range(count):
        t = exposure * ((i + 0.5) / count - 0.5)
        place = add(at.position, scale(at.velocity, t))
        turn = integrate(at.attitude, at.angular_velocity, t)
        mean += room.draw(CAMERA, at._replace(position=place, attitude=turn)) / count

    def off(exposure: float) -> float:
        optics = Optics(exposure=exposure, row_time=0, aperture=0, **CLEAN)
        return float(numpy.abs(draw(floor(), optics, at) - mean)[20:-20, 20:-20].mean())

    # interpolation between pixels smooths a little more
    assert off(exposure) < 0.25 * off(0.0)
    assert off(exposure) < 0.75 * min(off(0.6 * exposure), off(1.4 * exposure))


def test_the_motion_over_the_exposure_is_speed_times_focal_length_over_height() -> None:
    shot = Shot(PLAIN, body(velocity=(1.0, 0.0, 0.0)), 0.0)
    moved = motion(shot, grid(PLAIN.lens, 80), 0.004)
    assert moved[..., 0] == pytest.approx(0.0, abs=1e-9)
    assert moved[..., 1] == pytest.approx(462.0 * 0.004 / 1.15)


def steepest(optics: Optics, z: float) -> float:
    image = draw(floor(24, 0.03, 0.015), optics, body(0.3, -0.4, z), PLAIN).astype(float)
    return float(numpy.abs(numpy.diff(image, axis=1)).max())


@pytest.mark.thorough
def test_what_is_nearer_than_the_focus_is_blurred_the_more_the_nearer() -> None:
    optics = Optics(exposure=0, row_time=0, focus=0.4, aperture=0.002, **CLEAN)
    assert steepest(optics, 0.6) == steepest(SHARP, 0.6)
    at = [steepest(optics, z) / steepest(SHARP, z) for z in (0.3, 0.2, 0.12)]
    assert 0.98 > at[0] > 0.8 > at[1] > 0.4 > at[2] > 0.05


def test_the_same_seed_draws_the_same_and_another_seed_another() -> None:
    optics = Optics(covered=0.3, missing=0.1)
    first, second, other = (Room(floor(), optics, seed) for seed in (1, 1, 2))
    frames = [[room.draw(CAMERA, FAST) for _ in range(2)] for room in (first, second, other)]
    assert (frames[0][0] == frames[1][0]).all()
    assert (frames[0][1] == frames[1][1]).all()
    assert (frames[0][0] != frames[0][1]).any()
    assert (frames[0][0] != frames[2][0]).any()


def test_covered_and_missing_tags_are_as_many_as_asked_and_stay_the_same() -> None:
    tags, at = floor(), body(x=0.5, z=1.8)
    whole = find(draw(tags, SHARP, at)).keys()
    assert len(whole) >= 30
    room = Room(tags, SHARP, 3)
    some = find(room.draw(CAMERA, at, Weakness(covered=0.3))).keys()
    more = find(room.draw(CAMERA, at, Weakness(covered=0.6))).keys()
    assert more < some < whole
    missing = find(draw(tags, Optics(**CLEAN, missing=0.5), at)).keys()
    assert 0.25 * len(whole) < len(missing) < 0.75 * len(whole)
    assert find(draw(tags, Optics(**CLEAN, missing=1.0), at)) == {}


def test_misplaced_tags_lie_in_each_others_places_as_many_as_asked() -> None:
    small = [Tag("36h11", 100, 0.1, (2.0, 0.0, 0.0), LEVEL)]
    tags = TagMap([*floor(), *small])
    laid = swapped(tags, 0.25, 3)
    wrong = {tag.id for tag in tags if laid.get(*tag.key) != tag}
    assert len(wrong) == 9
    assert 100 not in wrong
    assert sorted(t.position for t in laid) == sorted(t.position for t in tags)
    assert laid == swapped(tags, 0.25, 3) != swapped(tags, 0.25, 4)

    at = body(x=0.5, z=1.8)
    shot = Shot(CAMERA, at, 0.0)
    found = find(draw(tags, Optics(**CLEAN, row_time=0.0, misplaced=0.25), at, seed=3))
    assert len(found) >= 25
    off = set()
    for number, corners in found.items():
        expected, _ = shot.project(numpy.array(tags.get("36h11", number).corners()))
        if numpy.abs(expected - corners).max() > 20.0:
            off.add(number)
    assert off == wrong & found.keys() != set()


def test_a_patch_hides_what_it_lies_on() -> None:
    tags, at = floor(), body()
    patched = Optics(**CLEAN, patches=((0.48, -0.48, 0.1),))
    assert find(draw(tags, Optics(**CLEAN), at)).keys() - find(draw(tags, patched, at)) == {14}


def test_tags_out_of_view_cost_nothing() -> None:
    near = list(floor(10))
    far = [
        Tag("36h11", 100 + i, 0.12, (5.0 + 0.24 * (i % 99), 0.24 * (i // 99), 0.0), LEVEL)
        for i in range(9900)
    ]
    few, many = Room(TagMap(near), SHARP, 1), Room(TagMap(far + near), SHARP, 1)
    assert (few.draw(CAMERA, body()) == many.draw(CAMERA, body())).all()
    assert many._floor._sheets.keys() == few._floor._sheets.keys()


@pytest.mark.parametrize("at", [body(z=0.05), body(z=-0.2), body(pitch=3.0)])
def test_a_camera_that_sees_no_floor_gives_a_frame_all_the_same(at: Truth) -> None:
    image = draw(floor(), Optics(), at)
    assert image.shape == (480, 640)
    assert find(image) == {}


def test_without_light_a_frame_is_noise_and_more_blur_blurs() -> None:
    room = Room(floor(), Optics(), 1)
    dark = room.draw(CAMERA, body(), Weakness(dark=True))
    assert dark.mean() < 3.0
    assert dark.std() > 0.5
    blurred = room.draw(CAMERA, body(), Weakness(blur=4.0))
    assert find(room.draw(CAMERA, body())).keys() > find(blurred).keys()


pytest.importorskip("cv2")


@pytest.mark.parametrize(("dx", "dy"), [(6.0, 0.0), (3.0, -4.0), (0.3, 0.2), (-7.3, 1.1)])
def test_a_streak_is_a_line_about_its_middle(dx: float, dy: float) -> None:
    kernel = streak(dx, dy)
    half = len(kernel) // 2
    x = numpy.arange(-half, half + 1)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-5)
    assert kernel.sum(axis=0) @ x == pytest.approx(0.0, abs=1e-5)
    assert kernel.sum(axis=1) @ x == pytest.approx(0.0, abs=1e-5)
    # a line's variance is length^2/12; a pixel's linear weights add at most 1/4
    assert 0.0 <= kernel.sum(axis=0) @ x**2 - dx * dx / 12.0 <= 0.25
    assert 0.0 <= kernel.sum(axis=1) @ x**2 - dy * dy / 12.0 <= 0.25


@pytest.mark.parametrize("depth", [0.1, 0.2, 0.8])
def test_the_blur_of_a_point_is_the_thin_lens_disc(depth: float) -> None:
    optics = Optics(blur=1.0, focus=0.4, aperture=0.003)
    image = numpy.zeros((101, 101), numpy.uint8)
    image[:, 50:] = 200
    edge = numpy.diff(blur_lens(image, optics, 500.0, depth, 0.0)[50].astype(float)) / 200.0
    disc = 500.0 * 0.003 * max(0.0, 1.0 / depth - 1.0 / 0.4)
    spread = sqrt(edge @ (numpy.arange(100) - edge @ numpy.arange(100)) ** 2)
    assert spread == pytest.approx(sqrt(1.0 + (disc / 4.0) ** 2), rel=0.05)


def test_noise_grows_with_the_light_as_asked() -> None:
    optics = Optics(brightness=0.8, read_noise=2.0, shot_noise=5.0)
    noise = ImageNoise(200, 300, numpy.random.default_rng(1))
    for light in (60, 150, 255):
        grey = 0.8 * light
        drawn = noise.expose(numpy.full((200, 300), light, numpy.uint8), optics).astype(float)
        assert drawn.mean() == pytest.approx(grey, abs=0.1)
        expected = sqrt(4.0 + 25.0 * grey / 255.0 + 1.0 / 12.0)  # the last is by rounding
        assert drawn.std() == pytest.approx(expected, rel=0.03)


def test_too_much_light_is_white_and_none_is_black() -> None:
    noise = ImageNoise(20, 30, numpy.random.default_rng(1))
    optics = Optics(brightness=2.0, read_noise=0.0, shot_noise=0.0)
    assert (noise.expose(numpy.full((20, 30), 200, numpy.uint8), optics) == 255).all()
    assert (noise.expose(numpy.zeros((20, 30), numpy.uint8), optics) == 0).all()
