"""The map of a report: the fence, the obstacles and the points that stand in the room."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from recorded_run import write_run

from kybflow.report.data import MovingTrack, RecordedWorld, read_run, read_world
from kybflow.report.map import Extent, outline, path_map
from kybflow.world.scanned import PointCloud
from kybflow.world.shapes import Box, Cylinder, Plane, Sphere

WORLD = RecordedWorld(
    {"pillar": (1.0, 0.5, 1.0), "pad": (0.0, -1.0, 0.0), "above": (0.0, -1.0, 1.0)},
    {
        "pillar": Cylinder((1.0, 0.5, 0.0), 0.2, 2.0),
        "ball": Sphere((-1.0, 0.5, 1.0), 0.3),
        "crate": Box((-2.0, -2.0, 0.0), (-1.5, -1.0, 0.5)),
        "wall": Plane((2.5, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        "floor": Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        "mast": Cylinder((80.0, 0.0, 0.0), 0.2, 9.0),
    },
)
WRITTEN = """
world:
  points: {pillar: [1 m, 0.5 m, 1 m], pad: [0 m, -1 m, 0 m], above: [0 m, -1 m, 1 m]}
  obstacles:
    pillar: {cylinder: {at: [1 m, 0.5 m, 0 m], radius: 0.2 m, height: 2 m}}
    ball: {sphere: {at: [-1 m, 0.5 m, 1 m], radius: 0.3 m}}
    crate: {box: {from: [-2 m, -2 m, 0 m], to: [-1.5 m, -1 m, 0.5 m]}}
    wall: {plane: {at: [2.5 m, 0 m, 0 m], facing: [-1, 0, 0]}}
    floor: {plane: {at: [0 m, 0 m, 0 m], facing: [0, 0, 1]}}
    mast: {cylinder: {at: [80 m, 0 m, 0 m], radius: 0.2 m, height: 9 m}}
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return replace(read_run(write_run(tmp_path_factory.mktemp("run"), 12.0)), world=WORLD)


def test_the_world_is_read_from_the_resolved_mission(tmp_path):
    path = tmp_path / "mission.resolved.yaml"
    assert read_world(path) == RecordedWorld()
    path.write_text(WRITTEN, encoding="utf-8")
    assert read_world(path) == WORLD


@pytest.mark.parametrize("text", ["[]", "world: {points: {a: 3}}", "world: {obstacles: {a: {}}}"])
def test_a_world_that_no_run_has_written_is_an_error(tmp_path, text):
    path = tmp_path / "mission.resolved.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="no readable world"):
        read_world(path)


def test_the_fence_is_drawn_and_lies_in_the_picture(recorded):
    layout = path_map(recorded).layout
    [fence] = layout["shapes"]
    assert (fence["x0"], fence["y0"], fence["x1"], fence["y1"]) == (-3.0, -3.0, 3.0, 3.0)
    assert (fence["name"], fence["showlegend"]) == ("fence", True)
    for axis in ("xaxis", "yaxis"):
        low, high = layout[axis]["range"]
        assert -4.0 < low < -3.0
        assert 3.0 < high < 4.0


def test_every_obstacle_and_point_has_its_name(recorded):
    figure = path_map(recorded)
    obstacles = [t for t in figure.traces if t["name"] == "obstacle"]
    named = ["".join(t["text"]) for t in obstacles]
    assert named == ["pillar", "ball", "crate", "wall", "mast"]
    assert [t["showlegend"] for t in obstacles] == [True, False, False, False, False]
    [points] = [t for t in figure.traces if t["name"] == "named point"]
    assert points["text"] == ["", "pad, above"]
    assert points["customdata"] == ["pillar", "pad, above"]
    assert "Not drawn because horizontal: floor." in figure.note
    assert "Outside this map: obstacle mast." in figure.note


def test_a_fence_far_away_does_not_squash_the_path(recorded):
    far = replace(recorded, mission={**recorded.mission, "fence": [[-90, -90, 0], [90, 90, 30]]})
    figure = path_map(far)
    assert "Outside this map: the fence" in figure.note
    low, high = figure.layout["xaxis"]["range"]
    assert high - low < 8.0


def test_outlines_from_above():
    window = Extent(-3.0, -3.0, 3.0, 3.0)
    xs, ys = outline(Cylinder((1.0, 2.0, 0.0), 0.5, 1.0), window)
    radii = [hypot(x - 1.0, y - 2.0) for x, y in zip(xs, ys, strict=True)]
    assert radii == pytest.approx([0.5] * len(xs))
    box = ([0.0, 2.0, 2.0, 0.0, 0.0], [1.0, 1.0, 3.0, 3.0, 1.0])
    assert outline(Box((0.0, 1.0, 0.0), (2.0, 3.0, 1.0)), window) == box
    xs, ys = outline(WORLD.obstacles["wall"], window)
    assert xs == pytest.approx([2.5] * 3)
    assert max(ys) > 3.0
    assert min(ys) < -3.0
    assert outline(WORLD.obstacles["floor"], window) == ([], [])


def test_a_scan_is_drawn_by_its_points_and_read_from_the_copy_of_its_file(tmp_path):
    (tmp_path / "scan.xyz").write_text("1000 2000 500\n1000 2000 0\n1400 2000 500\n")
    path = tmp_path / "mission.resolved.yaml"
    of = "file: scan.xyz, radius: 0.1 m, units: mm, at: [0.05 m, 0.05 m, 0 m], heading: 0 deg"
    path.write_text(f"world: {{obstacles: {{heap: {{point_cloud: {{{of}, above: 0.1 m}}}}}}}}")
    heap = read_world(path).obstacles["heap"]
    assert heap.array == pytest.approx(np.array([[1.05, 2.05, 0.5], [1.45, 2.05, 0.5]]))
    assert heap.radius == 0.1
    xs, ys = outline(heap, Extent(-3.0, -3.0, 3.0, 3.0))
    assert xs[5] is None
    assert xs[:5] == pytest.approx([0.95, 1.15, 1.15, 0.95, 0.95])
    assert ys[:5] == pytest.approx([1.95, 1.95, 2.15, 2.15, 1.95])
    assert xs[6:11] == pytest.approx([1.35, 1.55, 1.55, 1.35, 1.35])
    (tmp_path / "scan.xyz").unlink()
    assert read_world(path).obstacles == {}


def test_a_map_is_read_from_the_copies_of_its_files(tmp_path):
    (tmp_path / "maps").mkdir()
    info = "image: lab.pgm\nresolution: 0.5\norigin: [0, 0, 0]\noccupied_thresh: 0.65\n"
    (tmp_path / "maps" / "lab.yaml").write_text(info)
    (tmp_path / "maps" / "lab.pgm").write_bytes(b"P5\n3 1\n255\n\xfe\x00\x00")
    path = tmp_path / "mission.resolved.yaml"
    path.write_text(
        "world: {obstacles: {walls: "
        "{occupancy: {file: maps/lab.yaml, height: 2 m, foot: 0.5 m}, contact: allowed}}}"
    )
    walls = read_world(path).obstacles["walls"]
    assert (walls.places, walls.low, walls.high) == (((0.75, 0.25), (1.25, 0.25)), 0.5, 2.5)
    xs, _ = outline(walls, Extent(-3.0, -3.0, 3.0, 3.0))
    assert min(x for x in xs if x is not None) < 0.75
    (tmp_path / "maps" / "lab.pgm").unlink()
    assert read_world(path).obstacles == {}


def test_a_scan_has_its_name_in_the_map(recorded):
    world = RecordedWorld({}, {"heap": PointCloud(((1.0, 1.0, 0.0), (1.5, 1.0, 0.0)), 0.1)})
    [heap] = [t for t in path_map(replace(recorded, world=world)).traces if t["name"] == "obstacle"]
    assert "".join(heap["text"]) == "heap"


def test_where_a_moving_obstacle_went_is_drawn_and_lies_in_the_picture(recorded):
    place = np.array([[2.0, 0.0, 1.0], [3.2, 1.0, 1.0]])
    moving = {"ball": MovingTrack(np.array([0.0, 5.0]), place, 0.5)}
    figure = path_map(replace(recorded, moving=moving))
    assert [t["name"] for t in figure.traces].count("moving obstacle") == 1
    [label] = [t for t in figure.traces if t.get("mode") == "text"]
    assert (label["x"], label["y"], label["text"]) == ([2.0], [0.0], ["ball"])
    assert figure.layout["xaxis"]["range"][1] > 3.7


def mark(recorded, name, event, **fields):
    """The marker of an event at 6 s in the map."""
    told = {"t_s": 6.0, "event": event, "vehicle": "mk", "at": "", "fields": fields}
    [found] = [t for t in path_map(replace(recorded, events=[told])).traces if t["name"] == name]
    return found


def test_a_collision_is_marked_where_it_was(recorded):
    cross = mark(recorded, "collision", "collided", into="nano")
    mk = recorded.tracks[0]
    place = mk.position[(mk.time >= 6.0).argmax()]
    assert (cross["x"][0], cross["y"][0]) == pytest.approx(tuple(place[:2]), abs=0.02)
    assert cross["text"] == ["mk ran into nano"]


def test_a_hard_landing_is_marked_with_its_speed(recorded):
    cross = mark(recorded, "collision", "landed_hard", onto="the floor", speed=1.624)
    assert cross["text"] == ["mk landed hard (1.62 m/s) on the floor"]


def test_a_payload_is_marked_where_it_came_to_rest(recorded):
    square = mark(recorded, "payload", "payload_rested", x=0.4, y=-0.2, z=0.0)
    assert (square["x"], square["y"], square["text"]) == ([0.4], [-0.2], ["the payload of mk"])
