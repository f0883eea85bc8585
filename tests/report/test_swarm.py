"""The figures of several vehicles: distances are those of who flies, with the mission's bound."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_page import unpacked

from kybflow.report.data import MovingTrack, RecordedRun, RecordedWorld, StateVisit, Track
from kybflow.report.figures import alarm_distances, least_separation, swarm_figures

TIME = np.linspace(0.0, 10.0, 101)


def track(name: str, x: float, flies_until: float = 10.0) -> Track:
    flies = np.where(flies_until >= TIME, 0.01, np.nan)
    place = np.stack([np.full(101, x), 0.1 * TIME, np.ones(101)], axis=1)
    return Track(name, [x, 0, 0], TIME, place, place, flies, flies, flies, TIME, flies, ())


def recording_of(
    *tracks: Track, expect: str = "always separation(a and b) > 60 cm", **more: Any
) -> RecordedRun:
    summary = {"expectations": [{"text": expect}]}
    return RecordedRun({}, summary, {}, [], tracks, 10.0, RecordedWorld(), **more)


def facts(**kept: float) -> dict[str, Any]:
    """What a recording's head says of a vehicle."""
    return {"keeps_apart": kept}


def test_one_vehicle_has_no_such_figures() -> None:
    assert swarm_figures(recording_of(track("a", 0.0))) == []


def test_each_pair_has_its_distance_while_both_fly_and_the_bound_is_shown() -> None:
    _, distances = swarm_figures(
        recording_of(track("a", 0.0), track("b", 1.0), track("c", 3.0, 5.0))
    )
    curves = {trace["name"]: unpacked(trace["y"]) for trace in distances.traces}
    assert list(curves) == ["a and b", "a and c", "b and c", "expected above 0.6 m"]
    assert curves["a and b"] == pytest.approx(np.ones(101))
    assert curves["b and c"][:51] == pytest.approx(np.full(51, 2.0))
    assert np.isnan(curves["b and c"][52:]).all()
    assert curves["expected above 0.6 m"] == pytest.approx([0.6, 0.6])


def test_the_distances_below_which_supervisors_alarm_are_shown() -> None:
    heads = {"a": facts(b=0.6, c=0.3), "b": facts(a=0.6, c=0.0)}
    two = replace(recording_of(track("a", 0.0), track("b", 1.0)), mission={"vehicles": heads})
    assert alarm_distances(two) == [0.3, 0.6]
    names = [trace["name"] for trace in swarm_figures(two)[1].traces]
    assert names == ["a and b", "alarm below 0.3 m", "alarm below 0.6 m", "expected above 0.6 m"]


def test_of_many_vehicles_each_has_its_distance_to_the_nearest() -> None:
    many = recording_of(*(track(f"v{n}", 2.0 * n) for n in range(10)))
    _, distances = swarm_figures(many)
    assert len(distances.traces) == 11
    assert unpacked(distances.traces[4]["y"]) == pytest.approx(np.full(101, 2.0))


@pytest.mark.parametrize(
    ("text", "bound"),
    [
        ("always separation(swarm) > 1 m", 1.0),
        ("always separation(swarm) > 80 cm and a.state.z < 2 m", 0.8),
        ("finally a in landed", None),
    ],
)
def test_the_bound_is_the_expectations(text: str, bound: float | None) -> None:
    assert (
        least_separation(replace(recording_of(), summary={"expectations": [{"text": text}]}))
        == bound
    )


def test_the_swarm_from_above_shows_who_flies_at_each_moment() -> None:
    above, _ = swarm_figures(recording_of(track("a", 0.0), track("b", 1.0, 5.0)))
    dots = [trace for trace in above.traces if trace.get("mode") == "markers+text"]
    assert [len(trace["x"]) for trace in dots] == [2, 2, 2, 2, 2, 1, 1, 1, 1]


def dots(figure: Any, mode: str) -> list[dict[str, Any]]:
    return [trace for trace in figure.traces if trace.get("mode") == mode]


def test_a_moving_obstacle_is_shown_at_each_moment_beside_a_single_vehicle_too() -> None:
    ball = MovingTrack(TIME, np.stack([TIME, 0 * TIME, 1 + 0 * TIME], axis=1), 0.2)
    [above] = swarm_figures(recording_of(track("a", 0.0), moving={"ball": ball}))
    named = [(trace["text"], trace["x"]) for trace in dots(above, "text")]
    assert [text for [text], _ in named] == [f"{second}" for second in range(1, 10)]
    assert [x for _, [x] in named] == pytest.approx([*range(1, 10)])


@pytest.mark.parametrize("hears", [False, True])
def test_lines_join_those_who_hear_each_other(hears: bool) -> None:
    visit = StateVisit("square", "formation", 0.0, 10.0, "", True, False, hears)
    pair = (replace(track(name, x), visits=(visit,)) for name, x in (("a", 0.0), ("b", 1.0)))
    above, _ = swarm_figures(recording_of(*pair))
    edges = [trace for trace in above.traces if trace.get("name") == ""]
    assert [len(trace["x"]["bdata"]) > 0 for trace in edges] == [hears] * 9
