"""The figures of several vehicles: distances are those of who flies, with the mission's bound."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from kybflow.report.data import RecordedWorld, Run, Track
from kybflow.report.swarm import least_separation, swarm_figures

TIME = np.linspace(0.0, 10.0, 101)


def track(name: str, x: float, flies_until: float = 10.0) -> Track:
    flies = np.where(flies_until >= TIME, 0.01, np.nan)
    place = np.stack([np.full(101, x), 0.1 * TIME, np.ones(101)], axis=1)
    return Track(name, [x, 0, 0], TIME, place, place, flies, flies, flies, TIME, flies, ())


def run(*tracks: Track, expect: str = "always separation(a and b) > 60 cm") -> Run:
    summary = {"expectations": [{"text": expect}]}
    return Run({}, summary, {}, [], tracks, 10.0, RecordedWorld())


def values(trace: dict[str, Any]) -> Any:
    return np.frombuffer(base64.b64decode(trace["y"]["bdata"]), "<f4")


def test_one_vehicle_has_no_such_figures() -> None:
    assert swarm_figures(run(track("a", 0.0))) == []


def test_each_pair_has_its_distance_while_both_fly_and_the_bound_is_shown() -> None:
    _, distances = swarm_figures(run(track("a", 0.0), track("b", 1.0), track("c", 3.0, 5.0)))
    curves = {trace["name"]: values(trace) for trace in distances.traces}
    assert list(curves) == ["a and b", "a and c", "b and c", "least allowed"]
    assert curves["a and b"] == pytest.approx(np.ones(101))
    assert curves["b and c"][:51] == pytest.approx(np.full(51, 2.0))
    assert np.isnan(curves["b and c"][52:]).all()
    assert curves["least allowed"] == pytest.approx([0.6, 0.6])


def test_of_many_vehicles_each_has_its_distance_to_the_nearest() -> None:
    many = run(*(track(f"v{n}", 2.0 * n) for n in range(10)))
    _, distances = swarm_figures(many)
    assert len(distances.traces) == 11
    assert values(distances.traces[4]) == pytest.approx(np.full(101, 2.0))


@pytest.mark.parametrize(
    ("text", "bound"),
    [
        ("always separation(swarm) > 1 m", 1.0),
        ("always separation(swarm) > 80 cm and a.state.z < 2 m", 0.8),
        ("finally a in landed", None),
    ],
)
def test_the_bound_is_the_expectations(text: str, bound: float | None) -> None:
    assert least_separation(replace(run(), summary={"expectations": [{"text": text}]})) == bound


def test_the_swarm_from_above_shows_who_flies_at_each_moment() -> None:
    above, _ = swarm_figures(run(track("a", 0.0), track("b", 1.0, 5.0)))
    dots = [trace for trace in above.traces if trace.get("mode") == "markers+text"]
    assert [len(trace["x"]) for trace in dots] == [2, 2, 2, 2, 2, 1, 1, 1, 1]
