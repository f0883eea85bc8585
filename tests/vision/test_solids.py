"""Obstacles and a parcel hide what is behind them, from wherever they are seen."""

from __future__ import annotations

import pytest

pytest.importorskip("cv2")

import cv2
import numpy
from tag_floors import CAMERA, grid, still
from test_drawing import find

from kybflow.core.geometry import LEVEL, Vec3, add, from_euler, norm, scale
from kybflow.core.signals import Truth
from kybflow.vision.rendering.drawing import Room
from kybflow.vision.rendering.shot import Shot
from kybflow.vision.rendering.shot import grid as nodes
from kybflow.vision.rendering.solids import Solids, cover, hides
from kybflow.world.cameras import Optics
from kybflow.world.scanned import PointCloud
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere
from kybflow.world.tags import Tag, TagMap

SHAPES: dict[str, Shape] = {
    "pillar": Cylinder((0.6, 0.6, 0.0), 0.1, 2.2),
    "table": Box((1.1, 0.9, 0.3), (1.5, 1.3, 0.5)),
    "ball": Sphere((0.7, 1.2, 0.8), 0.25),
}
PLACES = [
    still((0.8, 0.9, 1.2), from_euler(0.1, -0.1, 0.7)),
    still((0.9, 0.9, 2.8), from_euler(0.0, 0.0, 2.0)),
    still((0.5, 1.2, 0.9), from_euler(-0.2, 0.5, 0.3)),
    still((1.1, 0.6, 0.4), from_euler(0.0, -1.2, 3.0)),
]
"""Over the floor; high above; beside the ball; looking up along the pillar."""


def drawn(shape: Shape, body: Truth, row_time: float = 0.0) -> numpy.ndarray:
    shot = Shot(CAMERA, body, row_time)
    image = numpy.zeros((480, 640), numpy.uint8)
    for solid in Solids({"it": shape}, 0.0, 1).in_view(shot, None):
        cover(image, shot, solid)
    return image


@pytest.mark.thorough
@pytest.mark.parametrize("body", PLACES)
@pytest.mark.parametrize("name", SHAPES)
def test_it_covers_the_pixels_whose_rays_meet_it(name: str, body: Truth) -> None:
    shape = SHAPES[name]
    image = (drawn(shape, body) > 0).astype(numpy.uint8)
    sure = cv2.erode(image, numpy.ones((5, 5))) == cv2.dilate(image, numpy.ones((5, 5)))
    assert sure.mean() > 0.9
    shot = Shot(CAMERA, body, 0.0)
    (turn,), (eye,) = shot.poses(numpy.zeros(1))
    fine = nodes(CAMERA.lens, 8)
    rays = fine.fill(fine.rays, fine.whole) @ turn.T
    solid = Solids({"it": shape}, 0.0, 1)._fixed[0]
    met = 0
    for row in range(0, 480, 16):
        for column in range(0, 640, 16):
            if sure[row, column]:
                ray: Vec3 = tuple(rays[row, column].tolist())
                far = add(tuple(eye.tolist()), scale(ray, 10.0 / norm(ray)))
                is_hit = hides(solid, tuple(eye.tolist()), far)
                assert is_hit == bool(image[row, column]), (row, column)
                met += is_hit
    assert (met > 0) == bool(image[sure].any())


def test_a_scan_is_seen_ball_by_ball() -> None:
    balls = [(0.7, 1.2, 0.8), (1.1, 0.9, 0.4)]
    scan = PointCloud(tuple(balls), 0.15)
    both = drawn(scan, PLACES[0])
    assert both.any()
    apart = [drawn(Sphere(ball, 0.15), PLACES[0]) > 0 for ball in balls]
    assert ((both > 0) == (apart[0] | apart[1])).all()


def test_what_is_seen_is_not_nothing() -> None:
    seen = {
        (name, i) for name in SHAPES for i, b in enumerate(PLACES) if drawn(SHAPES[name], b).any()
    }
    assert {
        ("pillar", 0),
        ("table", 0),
        ("ball", 0),
        ("pillar", 1),
        ("ball", 2),
        ("pillar", 3),
    } <= seen
    assert len(seen) < 12


def test_a_rolling_shutter_sees_its_corners_where_they_are_when_their_rows_are_exposed() -> None:
    table = Box((0.8, 0.8, 0.0), (1.1, 1.0, 0.3))
    body = Truth((0.9, 0.9, 1.2), (1.5, -1.0, 0.3), from_euler(0.1, 0.0, 0.4), (0.5, 0.5, 1.5))
    image = drawn(table, body, row_time=5e-5)
    corners = numpy.array([(x, y, z) for x in (0.8, 1.1) for y in (0.8, 1.0) for z in (0.0, 0.3)])
    pixels, _ = Shot(CAMERA, body, 5e-5).project(corners)
    still_ones, _ = Shot(CAMERA, body, 0.0).project(corners)
    assert numpy.abs(pixels - still_ones).max() > 3.0
    rows, columns = numpy.nonzero(image > 20)
    for seen, axis in ((columns, 0), (rows, 1)):
        assert seen.min() == pytest.approx(pixels[:, axis].min(), abs=1.0)
        assert seen.max() == pytest.approx(pixels[:, axis].max(), abs=1.0)


CLEAN = Optics(exposure=0.0, row_time=0.0, read_noise=0.0, shot_noise=0.0)
TAGS = TagMap(grid())
ABOVE = still((0.9, 0.9, 1.2))


def ids(room: Room, body: Truth = ABOVE) -> set[int]:
    return set(find(room.draw(CAMERA, body)))


@pytest.mark.thorough
def test_obstacles_and_a_parcel_hide_tags_and_nothing_else_changes() -> None:
    free = Room(TAGS, CLEAN, 1)
    obstacles = {"pillar": SHAPES["pillar"], "far": Sphere((9.0, 0.0, 0.0), 0.5)}
    full = Room(TAGS, CLEAN, 1, obstacles, 0.1)
    both = ids(free), ids(full)
    assert len(both[0]) > 20
    assert 2 <= len(both[0] - both[1]) <= 8
    assert not both[1] - both[0]
    with_parcel = ABOVE._replace(payload=(1.0, 0.9, 0.05))
    assert 1 <= len(both[1] - ids(full, with_parcel)) <= 4
    away = still((1.9, 1.7, 0.6))
    assert (free.draw(CAMERA, away) == full.draw(CAMERA, away)).all()


def test_a_tag_on_an_obstacle_is_seen_and_one_under_it_is_not() -> None:
    on = Tag("36h11", 500, 0.12, (0.9, 0.9, 0.4), LEVEL)
    under = Tag("36h11", 501, 0.12, (1.3, 0.9, 0.1), LEVEL)
    tags = TagMap([on, under])
    tables = {
        "low": Box((0.8, 0.8, 0.0), (1.0, 1.0, 0.4)),
        "high": Box((1.2, 0.8, 0.3), (1.4, 1.0, 0.4)),
    }
    assert ids(Room(tags, CLEAN, 1)) == {500, 501}
    assert ids(Room(tags, CLEAN, 1, tables)) == {500}


def test_inside_an_obstacle_there_is_nothing_else_to_see_and_a_wall_without_end_is_not_drawn() -> (
    None
):
    inside = Room(TAGS, CLEAN, 1, {"box": Box((0.0, 0.0, 1.0), (2.0, 2.0, 2.0))}).draw(
        CAMERA, ABOVE
    )
    assert inside.min() == inside.max()
    wall = Room(TAGS, CLEAN, 1, {"wall": Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))})
    assert (wall.draw(CAMERA, ABOVE) == Room(TAGS, CLEAN, 1).draw(CAMERA, ABOVE)).all()
