"""Objects in a recording, on its page and in the live table: where they are, what their goals are,
and what presses them."""

from __future__ import annotations

import re
from dataclasses import replace
from io import StringIO
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pushed_bar import MISSION
from rich.console import Console
from test_page import unpacked
from toolchain import compiled, with_library

from kybflow.api.flight import RunRequest, fly
from kybflow.cli.printing.live import LivePanel
from kybflow.core.signals import SeenObject
from kybflow.dsl.plan import Plan
from kybflow.parts.link import Contact
from kybflow.recording.layout import head, objects_record
from kybflow.report.data import RecordedRun, read_run
from kybflow.report.figures import figures
from kybflow.report.objects import ObjectMotion, ObjectTrack, RecordedObjects
from kybflow.report.plot import Figure

MORE = """\
    knob: {on: bar, at: [-5 cm, 0, 0], size: [4 cm, 4 cm, 4 cm], mass: 50 g}
    box: {at: [2, -1, 0.1], heading: 30 deg, size: [30 cm, 30 cm, 20 cm], mass: 2 kg}
"""
ASKED = """\
expect:
  - always bar.yaw > -70 deg and not bar.yaw > 30 deg and 20 deg > bar.yaw
  - finally car.position < 20 cm
  - finally 1 m/s > car.speed or car.position < 20 cm
  - max(bar.angle) < 10 deg
"""
SHOWN: list[str] = []


def looks(engine: Any) -> None:
    file, seen = StringIO(), engine.objects.seen
    box = seen.pop("box", None) if len(SHOWN) < 20 else None  # as if it were not seen
    console = Console(file=file, width=80)
    console.print(LivePanel(console).drawing(engine, 1.0))
    SHOWN.append(file.getvalue())
    if box is not None:
        seen["box"] = box


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    text = MISSION.replace("vehicles:\n", f"{MORE}vehicles:\n") + ASKED
    return compiled(with_library(tmp_path_factory.mktemp("push")) / "push.yaml", text)


@pytest.fixture(scope="module")
def run(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    folder = tmp_path_factory.mktemp("flown")
    flown = fly(plan, RunRequest(seed=1, out=folder / "run"), observers=(looks,))
    assert flown.summary["outcome"] == "succeeded", flown.summary["reason"]
    return read_run(Path(flown.folder))


def drawn(run: RecordedRun) -> dict[str, Figure]:
    return {figure.name: figure for figure in figures(run)}


def names(figure: Figure) -> list[str]:
    return [trace["name"] for trace in figure.traces]


def on_hardware(run: RecordedRun) -> RecordedRun:
    """What a recording holds where nobody knows the truth: the bar was lost for a second."""
    tracks = {
        name: replace(track, motions={"seen": track.motions["seen"]})
        for name, track in run.objects.tracks.items()
    }
    touched = run.objects.touched
    events = [
        {"t_s": t, "event": name, "vehicle": "", "at": "", "fields": {"object": "bar"}}
        for t, name in ((2.0, "object_lost"), (3.0, "object_found"))
    ]
    return replace(
        run, objects=RecordedObjects(tracks, {}, touched, run.objects.time), events=events
    )


def test_the_head_tells_what_moves_how_far_and_what_is_expected_of_it(plan: Plan) -> None:
    told = head(plan)["objects"]
    assert {name: one["coordinates"] for name, one in told.items()} == {
        "car": ["position"],
        "bar": ["yaw"],  # by the goals
        "box": ["x", "y", "yaw"],
    }
    assert len(told["car"]["boxes"]) == 8
    assert len(told["bar"]["boxes"]) == 24  # with its plate, and the knob that is a part of it
    assert [place for place, _ in told["car"]["stops"]] == [(0.5, 0.0, 0.8), (3.5, 0.0, 0.8)]
    assert told["box"]["stops"] == []
    assert told["car"]["goals"] == {"position": {"expected < 20 cm": 0.2}}
    assert [*told["bar"]["goals"]["yaw"]] == ["expected > -70 deg", "expected < 20 deg"]


def test_what_is_not_known_is_not_recorded() -> None:
    seen = SeenObject(1_500_000_000, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, 0.5, 0.1)
    told = objects_record({}, {"car": seen}, {}, {"v": "bar"})
    assert told["bar"] == {"force_n": {}, "touched_by": ["v"]}
    assert told["car"].keys() == {"force_n", "touched_by", "seen"}
    assert (told["car"]["seen"]["seen_s"], told["car"]["seen"]["q"]) == (1.5, 0.5)
    pressed = objects_record({}, {"car": seen}, {Contact("v", "car", "back"): 0.30004}, {})
    assert pressed["car"]["force_n"] == {"v.back": 0.3}


def test_the_objects_are_where_they_were_at_the_start_and_turned_at_the_end(
    run: RecordedRun,
) -> None:
    bar, car = run.objects.tracks["bar"], run.objects.tracks["car"]
    true, seen = bar.motions["true"], bar.motions["seen"]
    assert true.position[0] == pytest.approx((0.5, 0.0, 1.0))
    assert bar.outlines(0.0)[0].min(axis=0) == pytest.approx((0.47, -0.6))
    assert bar.outlines(0.0)[1].min(axis=0) == pytest.approx((0.46, 0.25))
    assert true.coordinate("yaw")[-1] < -0.2
    assert seen.coordinate("angle")[-1] == pytest.approx(true.q[-1], abs=0.02)
    assert np.ptp(car.motions["true"].position[:, 0]) < 0.1
    assert bar.outlines(run.end)[0].min(axis=0)[0] < 0.4


def test_an_outline_is_that_of_a_tilted_box() -> None:
    tilt = 0.5 * pi / 4
    box = np.array([[[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-0.1, 0.1)]])
    hatch = ObjectMotion(
        np.zeros(1), np.array([[2.0, 0.0, 1.0]]), np.array([[cos(tilt), 0.0, sin(tilt), 0.0]]),
        np.array([0.0]),
    )  # fmt: skip
    [outline] = ObjectTrack(["angle"], box, [], {}, {"true": hatch}).outlines(0.0)
    assert outline.max(axis=0) == pytest.approx((2.0 + 1.1 * cos(pi / 4), 1.0), abs=1e-5)
    assert len(outline) == 4


def test_the_map_has_the_objects_at_the_start_the_end_and_the_stops(run: RecordedRun) -> None:
    path = drawn(run)["path"]
    assert names(path).count("object") == 6
    stops = [trace for trace in path.traces if trace["name"] == "at a stop"]
    assert [trace["showlegend"] for trace in stops] == [True, False]
    assert {trace["line"]["dash"] for trace in stops} == {"3px,3px"}
    assert stops[0]["x"][0] == pytest.approx(0.42)
    labels = [trace["text"][0] for trace in path.traces if trace.get("mode") == "text"]
    assert labels == ["car", "bar", "box"]


def test_what_has_not_moved_is_drawn_once_from_above(run: RecordedRun) -> None:
    above = drawn(run)["from_above"]
    hovers = [trace["hovertemplate"] for trace in above.traces if trace["name"] == "object"]
    assert sum("object box" in hover for hover in hovers) == 1
    assert 2 <= sum("object bar" in hover for hover in hovers) <= 4
    low, high = above.layout["xaxis"]["range"]
    assert high - low < 3.5


def test_each_coordinate_has_a_figure_with_its_goals(run: RecordedRun) -> None:
    own = {name: figure for name, figure in drawn(run).items() if name.startswith("object_")}
    assert [*own] == [
        "object_car_position", "object_bar_yaw", "object_box_x", "object_box_y", "object_box_yaw",
    ]  # fmt: skip
    assert names(own["object_box_yaw"]) == ["true", "tracked"]
    bar = own["object_bar_yaw"]
    assert names(bar) == ["true", "tracked", "expected > -70 deg", "expected < 20 deg"]
    assert unpacked(bar.traces[2]["y"]) == pytest.approx([-70.0, -70.0])
    assert bar.layout["yaxis"]["title"]["text"] == "yaw (deg)"
    assert bar.layout["yaxis"]["range"] == pytest.approx([-74.5, 24.5], abs=0.1)
    low, high = own["object_box_x"].layout["yaxis"]["range"]
    assert (low, high) == pytest.approx((1.95, 2.05), abs=0.002)


def test_a_contact_is_an_event_and_a_curve(run: RecordedRun) -> None:
    force = run.objects.forces["v", "bar.left"]
    assert 0.05 < np.nanmax(force) < 2.0
    assert np.isnan(force[0])
    told = [event for event in run.events if event["event"].startswith("contact_")]
    assert told[0]["event"] == "contact_began"
    assert told[0]["fields"] == {"object": "bar", "surface": "left"}
    figure = drawn(run)["contacts"]
    assert names(figure)[:3] == ["v on bar.left", "began", "ended"]
    _, began, ended = figure.traces[:3]
    assert began["x"] == [event["t_s"] for event in told if event["event"] == "contact_began"]
    assert len(ended["x"]) == len(began["x"])
    assert ended["text"][0].startswith("v, object: bar, surface: left, lasted: ")


def test_without_the_truth_there_is_what_was_tracked_and_inferred(run: RecordedRun) -> None:
    figures = drawn(on_hardware(run))
    bar, contacts = figures["object_bar_yaw"], figures["contacts"]
    assert names(bar)[0] == "tracked"
    assert np.isnan(unpacked(bar.traces[0]["y"])).sum() == 1
    [band] = bar.layout["shapes"]
    assert (band["name"], band["x0"], band["x1"]) == ("not seen", 2.0, 3.0)
    assert names(contacts) == ["v on bar, inferred"]
    assert contacts.note.startswith("Nobody measures forces.")
    assert names(figures["path"]).count("object") == 6


def test_the_live_table_has_the_objects_and_who_touches_them(run: RecordedRun) -> None:
    flying = [table.partition("objects    ")[2].splitlines() for table in SHOWN[2:]]
    assert [car for car, *_ in flying] == ["car 0.00 m"] * len(flying)
    assert flying[10][2] == "           box not seen"
    assert flying[-1][2].startswith("           box x 2.00 m, y -1.00 m, yaw ")
    touched = [bar for _, bar, *_ in flying if re.fullmatch(r" *bar -\S+ deg, touched by v.*", bar)]
    assert 3 < sum(" N" in bar for bar in touched) < len(flying)
