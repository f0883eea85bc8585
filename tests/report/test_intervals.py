"""What lasted and what happened, as a report tells it: spans, lanes, labels, tables, endings."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from recorded_run import write_run

from kybflow.report.data import StateVisit, read_run
from kybflow.report.events import Interval, ending, estimators_in_use, faults_and_holds, shaded
from kybflow.report.figures import figures
from kybflow.report.page import render
from kybflow.report.timeline import narrow_labels, timeline


def event(time, name, vehicle="mk", **fields):
    told = {"t_s": time, "event": name, "vehicle": vehicle, "fields": fields}
    return {**told, "at": "a/eight.yaml:7"}


TOLD = [
    event(0.0, "preflight_passed", check="link"),
    event(0.1, "estimator_changed", estimator="mocap", previous=None),
    event(2.0, "fault_injected", fault="wind"),
    event(2.5, "estimator_changed", estimator="inertial", previous="mocap", reason="age"),
    event(3.0, "paused", by="operator"),
    event(4.0, "resumed", by="operator"),
    event(4.5, "fault_ended", fault="wind"),
    event(5.0, "failsafe_started", reaction="brake", reason="too close", value=1.0, bound=2.0),
    event(6.0, "failsafe_ended", reaction="brake", alarm="proximity_breached"),
    event(7.0, "estimator_lost", previous="inertial", reason="3 s are over"),
    event(7.0, "estimate_lost", reaction="land_blind", reason="none", value=0.0, bound=0.3),
    event(7.0, "failsafe_started", reaction="land_blind", reason="none left", value=0.0, bound=0.0),
    event(8.0, "fault_injected", fault="sag"),
    event(9.0, "collided", into="beam"),
]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    whole = read_run(write_run(tmp_path_factory.mktemp("run"), 12.0))
    return replace(whole, events=TOLD)


def test_faults_and_holds_last_from_event_to_event(recorded):
    assert faults_and_holds(recorded) == [
        Interval("fault at work", "mk", "wind", 2.0, 4.5),
        Interval("fault at work", "mk", "sag", 8.0, recorded.end),
        Interval("hold", "mk", "paused", 3.0, 4.0),
        Interval("hold", "mk", "brake", 5.0, 6.0),
    ]


def test_a_clamped_setpoint_lasts_from_event_to_event(recorded):
    told = [
        event(3.0, "clamp_started", processor="fence", reason="too high"),
        event(5.0, "clamp_ended", processor="fence", most="1.5 m", seconds=1.5),
        event(6.0, "clamp_started", processor="fence", reason="too high"),
    ]
    clamped = replace(recorded, events=told)
    assert faults_and_holds(clamped) == [
        Interval("clamped setpoint", "mk", "fence", 3.0, 5.0),
        Interval("clamped setpoint", "mk", "fence", 6.0, recorded.end),
    ]
    assert "clamps" in timeline(clamped).layout["yaxis"]["ticktext"][1]


def test_a_behavior_that_is_left_ends_its_hold(recorded):
    told = [event(3.0, "paused", by="operator"), event(5.0, "behavior_ended", how="asked")]
    assert faults_and_holds(replace(recorded, events=told)) == [
        Interval("hold", "mk", "paused", 3.0, 5.0)
    ]


def test_estimators_that_are_not_the_first_are_told_apart(recorded):
    assert estimators_in_use(recorded) == {
        "mk": [
            Interval("estimator", "mk", "mocap", 0.1, 2.5),
            Interval("fallback estimator", "mk", "inertial", 2.5, 7.0),
            Interval("no estimate", "mk", "no estimate", 7.0, recorded.end),
        ],
        "nano": [],
    }


def test_the_error_plots_shade_them_with_a_legend(recorded):
    drawn = {figure.name: figure for figure in figures(recorded)}
    for name in ("position_error", "velocity_error"):
        shapes = drawn[name].layout["shapes"]
        assert [(s["x0"], s["x1"]) for s in shapes] == [(s.start, s.end) for s in shaded(recorded)]
        assert [s["name"] for s in shapes if s["showlegend"]] == [
            "fault at work", "hold", "no estimate", "fallback estimator",
        ]  # fmt: skip
        assert shapes[0]["label"]["text"] == "mk: wind"


def test_the_timeline_has_a_lane_for_each(recorded):
    figure = timeline(recorded)
    axis = figure.layout["yaxis"]
    assert axis["ticktext"] == ["mk", "mk, faults", "mk, holds", "mk, estimator", "nano"]
    rows = dict(zip(axis["ticktext"], axis["tickvals"], strict=True))
    shown = {
        row: [t["text"][0] for t in figure.traces if t["type"] == "bar" and t["y"] == [y]]
        for row, y in rows.items()
    }
    assert shown["mk, faults"] == ["wind", "sag"]
    assert shown["mk, holds"] == ["paused", "brake"]
    assert shown["mk, estimator"] == ["mocap", "inertial", "no estimate"]
    [crash] = [t for t in figure.traces if t.get("name") == "collision"]
    assert crash["x"] == [9.0]


def test_a_name_that_does_not_fit_stands_above_its_bar():
    wide = StateVisit("steady", "hover", 0.0, 50.0, "done", aloft=True, built_in=False)
    narrow = [replace(wide, name="wait", start=50.0 + n, end=51.0 + n) for n in range(5)]
    levels, room = narrow_labels([wide, *narrow], 100.0)
    assert wide not in levels
    assert [levels.get(visit) for visit in narrow] == [0, 1, 2, None, 0]
    assert room > 3 * 13.0
    assert narrow_labels([wide], 100.0)[1] < 13.0


def test_every_event_stands_in_the_page(recorded):
    page = re.sub(r"<script.*?</script>", "", render(recorded), flags=re.DOTALL)
    notable, every = page.split("<summary>All 14</summary>")
    assert "<summary>12 unusual</summary>" in notable
    assert every.count("eight.yaml:7</code>") == 14
    assert all(f">{e['event']}<" in every for e in TOLD)
    rows = re.findall(r"<tr><td class=\"number\">[\d.]+</td>.*?</tr>", notable)[-12:]
    assert ">collided<" in rows[0]
    assert "into: beam" in rows[0]


def test_the_end_tells_the_fault_and_the_collision(recorded):
    def ended(state, events):
        vehicle = {"final": "ground", "behaviors": [{"name": state, "start_s": 9.5}]}
        return ending(replace(recorded, events=events, summary={"vehicles": {"mk": vehicle}}), "mk")

    assert ended("fault", TOLD) == "on the ground, in fault: none left, ran into beam at 9.00 s"
    assert ended("landed", []) == "on the ground"
