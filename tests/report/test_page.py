"""The report: made from the run folder alone, whole and offline."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from recorded_run import write_run

from kybflow.recording.recorder import VehicleChannel
from kybflow.recording.run_folder import RunFolderError
from kybflow.report.data import StateVisit, read_run
from kybflow.report.figures import figures
from kybflow.report.page import render, write_report
from kybflow.report.timeline import timeline


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run"), 12.0)


@pytest.fixture(scope="module")
def page(folder):
    return write_report(folder).read_text(encoding="utf-8")


def without_scripts(page: str) -> str:
    return re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)


def unpacked(packed: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed["bdata"]), "<f4")


def test_the_tracks_are_what_was_flown(folder):
    mk, nano = read_run(folder).tracks
    assert (mk.name, nano.name) == ("mk", "nano")
    assert mk.time[[0, 1, -1]] == pytest.approx([0.0, 0.02, 11.98])
    assert mk.visits == (
        StateVisit("up", "take_off", 0.0, 3.0, "done", aloft=False, built_in=False),
        StateVisit("steady", "hover", 3.0, 5.0, "done", aloft=True, built_in=False),
        StateVisit("eight", "figure_eight", 5.0, 9.0, "done", aloft=True, built_in=False),
        StateVisit("down", "land", 9.0, 11.996, "", aloft=False, built_in=False),
    )
    # 12 mm x sqrt(sin^2(a) + sin^2(a + 1) + sin^2(a + 2)), which is 1.13 to 1.31, and noise
    assert 0.012 < np.nanmin(mk.position_error) < np.nanmax(mk.position_error) < 0.018
    assert np.nanmax(nano.position_error) < np.nanmin(mk.position_error)
    assert nano.battery[[0, -1]] == pytest.approx([1.0, 1.0 - 11.0 / 900.0])


def test_the_distance_to_target_is_to_where_each_behavior_ends(folder):
    mk, _ = read_run(folder).tracks
    assert mk.to_target[0] == pytest.approx(1.0, abs=0.05)
    assert mk.to_target[mk.time < 3.0][-1] < 0.05
    start, end = mk.to_target[mk.time >= 9.0][[0, -1]]
    assert start == pytest.approx(1.0, abs=0.05)
    assert end < 0.05


@pytest.mark.thorough
def test_the_target_is_what_was_asked_for_where_something_else_was_followed(tmp_path, monkeypatch):
    """Processors keep the vehicle where it is; its behaviors ask for a place 5 m away."""
    recorded, far = VehicleChannel.tick, (5.0, 0.0, 0.0)

    def tick(self, now, estimate, wanted, *more):
        recorded(self, now, estimate, wanted._replace(position=far), *more)

    plain, _ = read_run(write_run(tmp_path / "plain", 12.0)).tracks
    monkeypatch.setattr(VehicleChannel, "tick", tick)
    held, _ = read_run(write_run(tmp_path / "held", 12.0)).tracks
    assert np.array_equal(held.reference, plain.reference)
    assert held.to_target == pytest.approx(np.linalg.norm(held.position - far, axis=1))
    assert held.position_error == pytest.approx(held.to_target)


def test_errors_are_those_in_the_air(tmp_path):
    run = write_run(tmp_path / "run", 12.0)
    summary = json.loads((run / "summary.json").read_text())
    summary["vehicles"]["mk"]["airborne_s"] = [[2.0, 9.0], [10.0, None]]
    (run / "summary.json").write_text(json.dumps(summary))
    mk, nano = read_run(run).tracks
    aloft = (mk.time >= 2.0) & (mk.time < 9.0) | (mk.time >= 10.0)
    assert np.array_equal(np.isnan(mk.position_error), ~aloft)
    assert np.array_equal(np.isnan(mk.velocity_error), ~aloft)
    assert not np.isnan(nano.position_error).any()


def test_the_summary_agrees_with_the_recording(folder):
    run = read_run(folder)
    for track in run.tracks:
        figures = run.summary["vehicles"][track.name]["position_error_m"]
        assert np.nanmean(track.position_error) == pytest.approx(figures["mean"], rel=0.02)
        assert np.nanmax(track.position_error) <= figures["max"] * 1.00001


def test_the_figures_are_those_of_the_papers_and_more(folder):
    drawn = {figure.name: figure for figure in figures(read_run(folder))}
    assert list(drawn) == [
        "path", "timeline", "from_above", "distances", "position_error", "velocity_error",
        "to_target", "height", "battery",
    ]  # fmt: skip
    path = drawn["path"]
    assert path.layout["yaxis"]["scaleanchor"] == "x"
    assert [t["name"] for t in path.traces] == ["mk", "nano", "reference", "reference", "start"]
    flown, reference = (unpacked(path.traces[n]["x"]) for n in (0, 2))
    assert np.abs(flown - reference).max() < 0.02
    assert np.abs(reference).max() == pytest.approx(0.73 * np.sin(2 * np.pi * 0.25), abs=0.01)
    bars = [t for t in drawn["timeline"].traces if t["type"] == "bar"]
    assert [bar["text"] for bar in bars] == [["up"], ["steady"], ["eight"], ["down"]] * 2
    alarm = drawn["timeline"].traces[-1]
    assert (alarm["name"], alarm["x"]) == ("alarm", [5.0])
    assert "battery_low" in alarm["text"][0]
    (end,) = {f.layout["xaxis"]["range"][1] for f in drawn.values() if f.over_time}
    assert end == pytest.approx(11.996, rel=0.02)


def test_errors_are_scaled_to_what_stays_in_the_air(folder):
    run = read_run(folder)
    mk = run.tracks[0]
    mk.position_error[mk.time < 3.0] = 5.0
    (errors,) = [figure for figure in figures(run) if figure.name == "position_error"]
    aloft = (mk.time >= 3.0) & (mk.time < 9.0)
    highest = 100.0 * np.nanmax(mk.position_error[aloft])
    assert errors.layout["yaxis"]["range"] == pytest.approx([0.0, 1.15 * highest])
    assert unpacked(errors.traces[0]["y"]).max() == 500.0


def test_the_page_needs_nothing_else(page):
    assert not re.findall(r"""<(?:link|img|iframe|script)\b[^>]*\b(?:src|href)=""", page)
    assert "Plotly" in page
    assert "@import" not in page
    data = re.search(r'<script type="application/json" id="figures">(.*?)</script>', page)
    assert data is not None
    names = [figure["name"] for figure in json.loads(data[1])]
    text = without_scripts(page)
    assert all(f'<div class="figure" id="{name}"></div>' in text for name in names)


def test_the_page_tells_what_held_and_by_how_much(page):
    text = without_scripts(page)
    assert "✗ failed" in text
    assert "Expectations: 2 of 3 held" in text
    assert re.search(r"✓ held.*?mean\(mk.*?0\.93 cm.*?\+0\.77 cm.*?eight\.yaml:31", text)
    assert re.search(r"✗ broken.*?max\(nano.*?1\.23 cm.*?\N{MINUS SIGN}1\.13 cm", text)
    assert "Two quadrotors trace &lt;the same&gt; eight." in text
    assert "Real-time factor</dt><dd>13.3 x" in text


def test_text_from_the_mission_cannot_leave_its_place(folder):
    run = read_run(folder)
    evil = "</script><script>alert(1)</script>"
    fields = {"why": evil, "traceback": evil}
    event = {"t_s": 1.0, "event": "landed", "vehicle": "mk", "at": evil, "fields": fields}
    page = render(replace(run, mission={**run.mission, "mission": evil}, events=[event]))
    assert evil not in page
    assert "<summary>traceback</summary><pre>&lt;/script" in page


def test_a_killed_run_still_has_a_report(tmp_path):
    folder = write_run(tmp_path, 12.0)
    (folder / "summary.json").unlink()
    log, events = folder / "log.mcap", folder / "events.jsonl"
    recorded = log.read_bytes()
    log.write_bytes(recorded[: len(recorded) * 45 // 100])
    events.write_text(events.read_text(encoding="utf-8")[:900], encoding="utf-8")

    run = read_run(folder)
    text = without_scripts(write_report(folder).read_text(encoding="utf-8"))

    assert 4.0 < run.end < 6.0
    assert run.tracks[0].visits[-1].ended == ""
    assert "✗ not finished" in text
    assert '<div class="figure" id="path"></div>' in text


def test_a_run_that_never_ticked_has_a_report_without_figures(tmp_path):
    text = without_scripts(write_report(write_run(tmp_path, 0.0)).read_text(encoding="utf-8"))
    assert "figure_eight" in text
    assert 'class="figure"' not in text


def test_ticks_of_another_layout_are_an_error_that_says_so(folder, monkeypatch):
    monkeypatch.setattr("kybflow.recording.messages.definition", lambda _: b"bool armed\n")
    with pytest.raises(RunFolderError, match=r"`log\.mcap` was recorded by another version"):
        read_run(folder)


@pytest.mark.parametrize("content", [None, b"", b"no recording at all, but long enough to read"])
def test_a_folder_that_is_no_run_is_an_error(tmp_path, content):
    if content is not None:
        (tmp_path / "log.mcap").write_bytes(content)
    with pytest.raises(RunFolderError, match="is not a readable run"):
        read_run(tmp_path)


def test_a_flow_has_a_row_of_phases_in_the_timeline(folder):
    run = read_run(folder)
    told = [
        ("phase_started", 1.0, {"flow": "team", "phase": "launch"}),
        ("phase_ended", 4.0, {"flow": "team", "phase": "launch", "how": "next"}),
        ("phase_started", 4.0, {"flow": "team", "phase": "land"}),
    ]
    events = [
        {"event": event, "t_s": time, "vehicle": "", "fields": fields, "at": ""}
        for event, time, fields in told
    ]
    figure = timeline(replace(run, events=[*run.events, *events]))
    axis = figure.layout["yaxis"]
    assert axis["ticktext"][:3] == ["mk", "nano", "flow team"]
    bars = [t for t in figure.traces if t["y"] == [axis["tickvals"][2]] and t["type"] == "bar"]
    assert [(bar["text"], bar["base"], bar["x"]) for bar in bars] == [
        (["launch"], [1.0], [3.0]),
        (["land"], [4.0], [run.end - 4.0]),
    ]
