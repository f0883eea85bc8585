"""A vehicle that knows where it is from an IMU and five positions a second."""

from __future__ import annotations

import pytest
from flights import down, hold, named, path, up
from plans import part, vehicle

from kybflow.dsl.plan import EstimatorPlan


def test_it_hovers_within_what_the_positions_are_good_for(run):
    source = part("estimators", "fusion", source="position")
    driver = part("drivers", "sim", position_noise=0.05, position_noise_up=0.08)
    flier = vehicle(
        "a",
        [up("hold", 1.0), hold(4.0, "down"), down()],
        estimators=(EstimatorPlan(source, None, 1.0, None),),
        driver=driver,
    )
    flown, told = run(flier)
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    [stream] = [
        e for e in named(told, "preflight_passed") if e.fields["check"] == "position stream"
    ]
    assert stream.fields["found"] == "5 Hz"
    off = flown.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"]
    assert off["max"] < 0.25
    assert off["mean"] == pytest.approx(0.07, abs=0.06)
