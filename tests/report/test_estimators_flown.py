"""A flight over tags, as its run folder and its report show it."""

from __future__ import annotations

import pytest

pytest.importorskip("cv2")

from toolchain import compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.report.data import read_run
from kybflow.report.estimator_pages import statistics_of
from kybflow.report.page import render

pytestmark = pytest.mark.thorough

MISSION = """
kybflow: 1
mission: seen
import: {std: kybflow/airframes}
world:
  fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}
  tags:
    floor:
      grid: {family: 36h11, count: [12, 12], size: 12 cm, spacing: 2 cm, at: [-0.77, -0.77, 0]}
airframes:
  seer:
    like: std.nano_plus
    cameras:
      down: {at: [0, 0, 0], facing: down, width: 320, height: 240, field_of_view: 70 deg,
             rate: 15 Hz}
vehicles:
  a:
    airframe: seer
    start: {at: [0, 0, 0.1]}
    estimators:
      - {use: mocap, healthy: age < 100 ms, recover_after: 500 ms}
      - {use: tag_camera, healthy: age < 300 ms}
    behaviors:
      up:   {do: take_off, height: 60 cm, then: hold}
      hold: {do: hover, for_time: 1.5 s, then: down}
      down: {do: land}
faults:
  - {when: a in hold and elapsed > 300 ms, on: a, inject: mocap_dropout, for: 300 ms}
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seen")
    plan = compiled(folder / "seen.yaml", MISSION, warns=True)
    flown = fly(plan, RunRequest(seed=2, out=folder / "run"))
    assert flown.exit_code == 0, flown.summary["reason"]
    return read_run(flown.folder)


def test_each_estimator_is_recorded_whether_it_is_flown_on_or_not(recorded):
    flown, *others = recorded.estimators
    mocap, tags = sorted(others, key=lambda estimated: estimated.name)
    assert (mocap.name, tags.name) == ("mocap", "tag_camera")
    ticks = len(flown.time)
    shares = [statistics_of(estimated, ticks).share for estimated in (mocap, tags)]
    assert sum(shares) == pytest.approx(1.0, abs=0.01)
    assert shares[0] > shares[1] > 0.05
    assert len(tags.intervals_used()) == 1
    assert statistics_of(tags, ticks).mean < 0.05
    assert (tags.age > 0.0).sum() > tags.used.sum()  # it was there long before


def test_pictures_show_tags_in_flight_and_at_each_change(recorded):
    times = [picture.time for picture in recorded.pictures]
    assert len(times) >= 4
    assert max(picture.used or 0 for picture in recorded.pictures) >= 4
    changes = [
        event["t_s"]
        for event in recorded.events
        if event["event"] == "estimator_changed" and event["fields"]["previous"]
    ]
    assert len(changes) == 2
    for change in changes:
        assert any(change - 0.2 < time <= change + 0.05 for time in times)


def test_the_page_shows_all_of_it(recorded):
    page = render(recorded)
    assert page.count('<details class="page" open>') == 2
    assert page.count("data:image/jpeg;base64,") == len(recorded.pictures)
    assert "<summary>2 changes</summary>" in page
    assert "<i>in use</i>" in page
