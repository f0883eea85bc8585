"""Objects in a recording and on its page: where they are, and what presses them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pushed_bar import MISSION
from toolchain import compiled, with_library

from kybflow.api.flight import RunRequest, fly
from kybflow.report.data import Run, read_run
from kybflow.report.figures import figures


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = with_library(tmp_path_factory.mktemp("push"))
    plan = compiled(folder / "push.yaml", MISSION)
    flown = fly(plan, RunRequest(seed=1, out=folder / "run"))
    assert flown.summary["outcome"] == "succeeded", flown.summary["reason"]
    return read_run(Path(flown.folder))


def test_the_objects_are_where_they_were_at_the_start_and_turned_at_the_end(run: Run) -> None:
    bar, car = run.objects["bar"], run.objects["car"]
    assert bar.position[0] == pytest.approx((0.5, 0.0, 1.0))
    assert bar.outlines(0.0)[0].min(axis=0) == pytest.approx((0.47, -0.6))
    assert bar.outlines(0.0)[1].min(axis=0) == pytest.approx((0.46, 0.25))
    assert bar.heading[-1] < -0.2
    assert np.ptp(car.position[:, 0]) < 0.1
    low = bar.outlines(run.end)[0].min(axis=0)
    assert low[0] < 0.4


def test_a_contact_is_an_event_and_a_curve(run: Run) -> None:
    force = run.objects["bar"].forces["v.left"]
    assert 0.05 < force.max() < 2.0
    told = [e for e in run.events if e["event"].startswith("contact_")]
    assert told[0]["event"] == "contact_began"
    assert told[0]["fields"] == {"object": "bar", "surface": "left"}
    names = [e["event"] for e in told]
    assert names.count("contact_began") == names.count("contact_ended")
    drawn = {figure.name: figure for figure in figures(run)}
    assert [trace["name"] for trace in drawn["contacts"].traces] == ["bar: v on left"]
    assert "object" in {trace.get("name") for trace in drawn["path"].traces}
