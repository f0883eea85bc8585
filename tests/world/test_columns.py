"""Columns: what is near, and the way out, beside cylinders one by one."""

from __future__ import annotations

import random
from itertools import pairwise
from math import inf

import numpy as np
import pytest

from kybflow.core.geometry import Vec3, add, scale
from kybflow.world.scanned import Columns
from kybflow.world.shapes import parts_of

RADIUS = 0.07


def scattered(count: int = 60) -> Columns:
    draw = random.Random(1).uniform
    places = tuple((draw(-1, 1), draw(-1, 1)) for _ in range(count))
    return Columns(places, RADIUS, 0.2, 1.5)


def places(seed: int = 2, count: int = 80) -> list[Vec3]:
    draw = random.Random(seed).uniform
    return [(draw(-2, 2), draw(-2, 2), draw(-0.5, 2.5)) for _ in range(count)]


def test_distance_is_that_of_the_nearest_cylinder() -> None:
    columns = scattered()
    for p in places():
        nearest = min(parts_of(columns), key=lambda part, p=p: part.distance(p))
        assert columns.distance(p) == pytest.approx(nearest.distance(p))


def test_who_stays_before_what_is_around_meets_no_column() -> None:
    columns, looked = scattered(20), 0
    for p in places():
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


def test_the_nearest_place_of_a_line() -> None:
    columns = scattered()
    for a, b in pairwise(places(3, 20)):
        room, place = columns.nearest_on(a, b)
        line = np.array(a) + np.linspace(0.0, 1.0, 1001)[:, None] * np.subtract(b, a)
        sampled = min(columns.distance(tuple(p)) for p in line)
        assert sampled - 5e-3 <= room <= sampled + 1e-6
        assert columns.distance(place) == pytest.approx(room, abs=1e-6)


def test_it_carries_over_its_cells_alone() -> None:
    columns = Columns(((0.0, 0.0), (0.1, 0.0)), RADIUS, 0.0, 1.2)
    assert columns.top(0.1, 0.05, 0.0) == 1.2
    assert columns.top(0.3, 0.0, 0.15) == 1.2
    assert columns.top(0.3, 0.0, 0.1) == -inf
