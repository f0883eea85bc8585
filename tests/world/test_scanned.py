"""Scanned obstacles beside plain arithmetic: what is near a point cloud or columns, the way out,
and how clouds are thinned."""

from __future__ import annotations

import random
from itertools import pairwise
from math import dist, inf, pi

import numpy as np
import pytest

from kybflow.core.geometry import Vec3, add, scale
from kybflow.world.scanned import Columns, PointCloud, placed, thinned
from kybflow.world.shapes import parts_of

RADIUS = 0.1


def scattered(count: int = 200, seed: int = 1) -> PointCloud:
    draw = random.Random(seed).uniform
    return PointCloud(tuple((draw(-1, 1), draw(-1, 1), draw(0, 2)) for _ in range(count)), RADIUS)


def places(seed: int = 2) -> list[Vec3]:
    draw = random.Random(seed).uniform
    return [(draw(-2, 2), draw(-2, 2), draw(-1, 3)) for _ in range(50)]


def test_distance_is_to_the_nearest_ball_and_the_way_out_leads_away_from_it() -> None:
    cloud = scattered()
    for p in places():
        room, out = cloud.distance(p), cloud.outward(p)
        nearest = min(cloud.points, key=lambda q, p=p: dist(p, q))
        assert room == pytest.approx(dist(p, nearest) - RADIUS)
        assert np.subtract(p, np.multiply(room + RADIUS, out)) == pytest.approx(np.array(nearest))


def test_on_a_point_the_way_out_is_up() -> None:
    cloud = PointCloud(((1.0, 0.0, 1.0), (5.0, 0.0, 0.0)), RADIUS)
    assert cloud.distance((1.0, 0.0, 1.0)) == -RADIUS
    assert cloud.outward((1.0, 0.0, 1.0)) == (0.0, 0.0, 1.0)
    assert cloud.around((1.0, 0.0, 1.0), 0.5) == [(-RADIUS, (0.0, 0.0, 1.0))]


def test_both_walls_of_a_corner_are_around_a_place_although_one_is_nearer() -> None:
    steps = [0.1 * k for k in range(-10, 11)]
    walls = [(1.0, y, z) for y in steps for z in steps] + [
        (x, 1.0, z) for x in steps for z in steps
    ]
    found = PointCloud(tuple(walls), 0.05).around((0.5, 0.3, 0.0), 1.0)
    assert found[0] == (pytest.approx(0.45), pytest.approx((-1.0, 0.0, 0.0)))
    assert any(out[1] < -0.99 and room == pytest.approx(0.65) for room, out in found)


def test_who_stays_before_what_is_around_meets_no_point() -> None:
    cloud, reach, looked = scattered(40), 1.5, 0
    for p in places():
        planes = cloud.around(p, reach)
        rooms = [room for room, _ in planes]
        assert rooms == sorted(rooms)
        if len(planes) == 8:
            continue
        looked += 1
        for q in cloud.points:
            way = np.subtract(q, p)
            behind = any(way @ np.array(out) <= -room - RADIUS + 1e-6 for room, out in planes)
            assert behind or dist(p, q) - RADIUS > reach
    assert looked > 20


@pytest.mark.thorough
def test_the_nearest_place_of_a_line() -> None:
    cloud = scattered()
    for a, b in pairwise(places(3)):
        room, place = cloud.nearest_on(a, b)
        line = np.array(a) + np.linspace(0.0, 1.0, 2001)[:, None] * np.subtract(b, a)
        sampled = min(cloud.distance(tuple(p)) for p in line)
        assert sampled - 2e-3 <= room <= sampled + 1e-9
        assert cloud.distance(place) == pytest.approx(room)
    assert cloud.nearest_on(a, a)[0] == pytest.approx(cloud.distance(a))


def test_it_carries_at_its_highest() -> None:
    cloud = PointCloud(((0.0, 0.0, 0.5), (0.0, 0.0, 1.0)), RADIUS)
    assert cloud.top(0.0, 0.0, 0.0) == pytest.approx(1.1)
    assert cloud.top(0.15, 0.0, 0.05) == pytest.approx(1.0, abs=1e-6)
    assert cloud.top(0.3, 0.0, 0.1) == -inf
    assert cloud.bounds == (pytest.approx((-0.1, -0.1, 0.4)), pytest.approx((0.1, 0.1, 1.1)))


def test_a_scan_is_turned_then_moved_and_cut_in_the_world() -> None:
    scan = np.array([[1000.0, 0.0, 0.0], [0.0, 1000.0, 1500.0]])
    found = placed(scan, 1e-3, (1.0, 2.0, 0.5), pi / 2, None)
    assert found == pytest.approx(np.array([[1.0, 3.0, 0.5], [0.0, 2.0, 2.0]]))
    assert placed(scan, 1e-3, (1.0, 2.0, 0.5), pi / 2, 0.5) == pytest.approx(found[1:])


def test_no_point_is_further_than_the_radius_from_one_that_is_kept() -> None:
    points = np.array(scattered(3000).points)
    kept = thinned(points, 0.4)
    assert len(kept) < len(points) / 2
    assert {*map(tuple, kept.tolist())} <= {*map(tuple, points.tolist())}
    assert max(min(dist(p, q) for q in kept) for p in points[:300]) <= 0.4


COLUMN = 0.07


def columns_at(count: int = 60) -> Columns:
    draw = random.Random(1).uniform
    places = tuple((draw(-1, 1), draw(-1, 1)) for _ in range(count))
    return Columns(places, COLUMN, 0.2, 1.5)


def around_columns(seed: int = 2, count: int = 80) -> list[Vec3]:
    draw = random.Random(seed).uniform
    return [(draw(-2, 2), draw(-2, 2), draw(-0.5, 2.5)) for _ in range(count)]


def test_distance_is_that_of_the_nearest_cylinder() -> None:
    columns = columns_at()
    for p in around_columns():
        nearest = min(parts_of(columns), key=lambda part, p=p: part.distance(p))
        assert columns.distance(p) == pytest.approx(nearest.distance(p))


def test_who_stays_before_what_is_around_meets_no_column() -> None:
    columns, looked = columns_at(20), 0
    for p in around_columns():
        planes = columns.around(p, 3.0)
        if columns.distance(p) <= 0.0 or len(planes) == 8:
            continue
        looked += 1
        assert planes[0][0] == pytest.approx(columns.distance(p))
        for part in parts_of(columns):
            room, out = part.distance(p), part.outward(p)
            touched = np.subtract(add(p, scale(out, -room)), p)
            assert any(touched @ np.array(o) <= -r + 1e-6 for r, o in planes) or room > 3.0
    assert looked > 40


def test_the_nearest_place_of_a_line_beside_columns() -> None:
    columns = columns_at()
    for a, b in pairwise(around_columns(3, 20)):
        room, place = columns.nearest_on(a, b)
        line = np.array(a) + np.linspace(0.0, 1.0, 1001)[:, None] * np.subtract(b, a)
        sampled = min(columns.distance(tuple(p)) for p in line)
        assert sampled - 5e-3 <= room <= sampled + 1e-6
        assert columns.distance(place) == pytest.approx(room, abs=1e-6)


def test_it_carries_over_its_cells_alone() -> None:
    columns = Columns(((0.0, 0.0), (0.1, 0.0)), COLUMN, 0.0, 1.2)
    assert columns.top(0.1, 0.05, 0.0) == 1.2
    assert columns.top(0.3, 0.0, 0.15) == 1.2
    assert columns.top(0.3, 0.0, 0.1) == -inf
