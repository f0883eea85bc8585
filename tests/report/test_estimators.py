"""The estimators in a report: from a recording in which all errors are known."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_run import LEVEL, REST, STARTED, make_plan
from test_page import unpacked

from kybflow.api.flight import RunRequest
from kybflow.core.geometry import from_euler, from_heading
from kybflow.core.signals import NS, Command, Estimate, Event, Truth
from kybflow.recording.recorder import Recorder, VehicleChannel
from kybflow.recording.run_folder import create_run_folder
from kybflow.report.data import Picture, read_run
from kybflow.report.estimator_pages import CHI_95, estimator_pages, statistics_of
from kybflow.report.page import render

SECONDS, CHANGE = 4.0, 3.0
TRUTH = Truth(REST, REST, LEVEL, REST)
COMMAND = Command(LEVEL, 10.0, REST, 0.0)


def estimate(x, age, spread, attitude=LEVEL):
    return Estimate(0, (x, 0.0, 0.0), REST, attitude, REST, "", age, spread)


def write(path, truth=TRUTH, names=("tags", "mocap"), attitude=LEVEL):
    """At rest in the origin. `tags` is 1 cm off, and 5 cm in its last tenth of a second; from
    CHANGE on it has no estimate, and `mocap`, 3 cm off, is flown on."""
    plan = replace(make_plan("mk"), simulated=truth is not None)
    written = create_run_folder(plan, path, STARTED)
    written.describe(plan, RunRequest(0).record(), STARTED)
    recorder = Recorder(written.log, plan)
    channel = recorder.vehicle("mk")
    fields = {"estimator": "tags", "previous": None, "reason": "the first estimate", "offset": 0.0}
    written.event(Event(0, "estimator_changed", "mk", fields, ""))
    for tick in range(round(SECONDS * 250)):
        now, t = tick * NS // 250, tick / 250
        tags = estimate(0.05 if t >= CHANGE - 0.1 else 0.01, 0.04, 0.005) if t < CHANGE else None
        found = dict(zip(names, (tags, estimate(-0.03, 0.01, 0.02, attitude)), strict=False))
        source = names[0] if t < CHANGE or len(names) == 1 else names[1]
        if tick == round(CHANGE * 250):
            why = {"reason": "`tags` has no <estimate>", "offset": 0.08, "blended": True}
            fields = {"estimator": source, "previous": "tags", **why}
            written.event(Event(now, "estimator_changed", "mk", fields, ""))
        candidates = [
            SimpleNamespace(name=name, estimate=e, is_usable=e is not None)
            for name, e in found.items()
        ]
        estimation = SimpleNamespace(candidates=candidates, source=source)
        channel.tick(now, found[source], None, None, COMMAND, truth, estimation)
    recorder.close()
    written.finish({"kybflow": 1})
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return read_run(write(tmp_path_factory.mktemp("estimators")))


def test_errors_are_those_from_the_truth_while_it_was_in_use(recorded):
    flown, tags, mocap = recorded.estimators
    assert [e.name for e in recorded.estimators] == ["", "tags", "mocap"]
    assert tags.intervals_used() == [(0.0, pytest.approx(CHANGE))]
    assert mocap.intervals_used() == [(pytest.approx(CHANGE), pytest.approx(SECONDS))]
    assert np.nanmax(np.abs(tags.error - [0.01, 0.0, 0.0])[:-60]) == pytest.approx(0.0, abs=1e-9)

    found = statistics_of(tags, 200)
    assert found.share == 0.75
    assert found.mean == pytest.approx((145 * 0.01 + 5 * 0.05) / 150)
    assert found.p99 == pytest.approx(0.05)
    assert found.highest == pytest.approx(0.05)
    assert found.within == pytest.approx(145 / 150)  # 5 cm are ten spreads, 1 cm is two
    assert (found.age_mean, found.age_highest) == (pytest.approx(0.04), pytest.approx(0.04))
    assert statistics_of(mocap, 200).mean == pytest.approx(0.03)
    assert statistics_of(flown, 200).mean == pytest.approx(
        (145 * 0.01 + 5 * 0.05 + 50 * 0.03) / 200
    )


def test_there_is_a_page_for_each_estimator_with_error_spread_and_age(recorded):
    first, second = estimator_pages(recorded)
    assert (first.track.name, second.track.name) == ("tags", "mocap")
    error, _, age = second.figures
    off, limit, x, *_ = error.traces
    assert unpacked(off["y"]) == pytest.approx(np.full(200, 3.0))
    assert unpacked(limit["y"]) == pytest.approx(np.full(200, 100.0 * CHI_95 * 0.02))
    assert unpacked(x["y"]) == pytest.approx(np.full(200, -3.0))
    assert x["visible"] == "legendonly"
    assert unpacked(age.traces[0]["y"]) == pytest.approx(np.full(200, 10.0))
    (shape,) = error.layout["shapes"]
    assert (shape["x0"], shape["x1"]) == (pytest.approx(CHANGE), pytest.approx(SECONDS))
    assert np.isnan(unpacked(first.figures[0].traces[0]["y"])[151:]).all()


def rows_of(page):
    rows = re.findall(r"<tr>(.*?)</tr>", page)
    return [" ".join(re.sub(r"<[^>]+>", " ", row).split()) for row in rows]


def test_the_tables_tell_shares_errors_and_why_it_changed(recorded):
    page = render(recorded)
    rows = rows_of(page)
    assert "mk tags 75.0 % 1.13 5.00 5.00 96.7 % 0.00 40 40" in rows
    assert "mk mocap 25.0 % 3.00 3.00 3.00 100.0 % 0.00 10 10" in rows
    assert "<code>tags</code> has no &lt;estimate&gt;" in page
    assert "<summary>1 changes</summary>" not in page
    assert "<summary>1 change</summary>" in page
    ids = re.findall(r'class="figure" id="(\w+)"', page)
    assert len(set(ids)) == len(ids)
    assert {f"estimator_{n}_{what}" for n in (0, 1) for what in ("error", "age")} <= {*ids}


def test_pictures_stand_camera_by_camera_in_the_page_of_their_estimator(recorded):
    jpeg = b"\xff\xd8\xff\xe0"
    pictures = (
        Picture("mk", "tags", "down", 1.5, 2, 1, jpeg),
        Picture("mk", "tags", "down", 3.0, None, None, jpeg),
        Picture("mk", "tags", "front", 4.5, 0, 0, jpeg),
    )
    page = render(replace(recorded, pictures=pictures))
    assert page.count('src="data:image/jpeg;base64,/9j/') == 3
    for caption in ("1.50 s: 2 tags used, 1 rejected", "3.00 s: no pose", "4.50 s: 0 tags used"):
        assert f"<figcaption>{caption}</figcaption>" in page
    assert page.count("<h3>Camera") == 2


def test_without_a_truth_nothing_is_claimed(tmp_path):
    recorded = read_run(write(tmp_path, truth=None))
    body = render(recorded)
    assert "because the truth is unknown" in body
    dashes = " ".join(["\N{EN DASH}"] * 5)
    assert f"mk tags 75.0 % {dashes} 40 40" in rows_of(body)
    mocap = estimator_pages(recorded)[1]
    assert unpacked(mocap.figures[0].traces[0]["y"])[0] == pytest.approx(4.0)


def test_a_lone_estimator_is_folded_up_and_says_once_how_it_was(tmp_path):
    recorded = read_run(write(tmp_path, names=("mocap",)))
    body = render(recorded)
    assert "<i>in use</i>" not in body
    assert '<details class="page"><summary>mk: mocap</summary>' in body


def test_a_run_in_which_none_was_recorded_has_no_section(recorded):
    assert "<h2>Estimators</h2>" not in render(replace(recorded, estimators=()))


def test_what_an_offset_adds_is_no_lie_of_a_spread(tmp_path, monkeypatch):
    """For half a second after the change, what is flown on is 8 cm from `mocap`."""
    began = VehicleChannel.tick

    def tick(self, now, flown, *more):
        if CHANGE <= now / NS < CHANGE + 0.5:
            flown = flown._replace(position=(0.05, 0.0, 0.0))
        began(self, now, flown, *more)

    monkeypatch.setattr(VehicleChannel, "tick", tick)
    flown, tags, mocap = read_run(write(tmp_path)).estimators
    blended = flown.time[flown.blended]
    assert (blended.min(), blended.max()) == (CHANGE, pytest.approx(CHANGE + 0.5, abs=0.021))
    assert not tags.blended.any()
    assert not mocap.blended.any()
    flown = statistics_of(flown, len(flown.time))
    assert flown.within == pytest.approx(170 / 175, abs=0.002)  # 5 of the 150 of `tags`
    assert flown.highest == pytest.approx(0.05)


def test_errors_in_yaw_and_attitude_are_told(tmp_path):
    leant = from_euler(0.02, 0.0, 0.05)
    truth = TRUTH._replace(attitude=from_heading(0.04))
    recorded = read_run(write(tmp_path, truth=truth, attitude=leant))
    mocap = recorded.estimators[2]
    assert mocap.yaw_error[0] == pytest.approx(0.01)
    assert mocap.attitude_error[0] == pytest.approx((0.01**2 + 0.02**2) ** 0.5, rel=0.01)
    assert statistics_of(mocap, 200).yaw_p99 == pytest.approx(0.01)
    _, attitude, _ = estimator_pages(recorded)[1].figures
    turn, yaw = (unpacked(trace["y"])[0] for trace in attitude.traces)
    assert (turn, yaw) == (pytest.approx(1.28, abs=0.01), pytest.approx(0.573, abs=0.001))


def test_a_yaw_beyond_half_a_turn_is_the_short_way(tmp_path):
    truth = TRUTH._replace(attitude=from_heading(-3.1))
    recorded = read_run(write(tmp_path, truth=truth, attitude=from_heading(3.1)))
    assert recorded.estimators[2].yaw_error[0] == pytest.approx(6.2 - 2.0 * np.pi)
