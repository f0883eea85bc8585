"""The computed delay margin is that of the flight: with three quarters of it as an additional delay
of commands a simulated vehicle comes to rest, with five quarters it oscillates."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hovering import DELAYED, as_px4, context, swings
from plans import NANO
from sim_worlds import FRAME

from kybflow.flight.geometric_law import GeometricParams, outer_loop
from kybflow.flight.loops.margins import margins
from kybflow.flight.loops.response import horizontal, vertical

MODELS = {0: horizontal, 2: vertical}
LATE = replace(DELAYED, command_latency=0.04)
OLD = replace(DELAYED, mocap_latency=0.06)


@pytest.mark.parametrize("axis", MODELS)
@pytest.mark.parametrize(
    ("frame", "params"),
    [(FRAME, DELAYED), (NANO, DELAYED), (as_px4(FRAME), DELAYED), (FRAME, LATE), (FRAME, OLD)],
    ids=["mk", "nano", "as PX4", "late commands", "old poses"],
)
def test_it_oscillates_within_a_quarter_of_the_computed_delay(frame, params, axis: int) -> None:
    site = context(frame, params)
    outer = outer_loop(GeometricParams(observer=0.0), frame, site.loop, site.dt)
    assert site.loop is not None
    margin = margins(MODELS[axis](outer, site.loop)).delay
    first, _, _, last = swings(frame, axis, 0.75 * margin, params)
    assert last < 0.3 * first, "it comes to rest"
    first, _, _, last = swings(frame, axis, 1.25 * margin, params)
    assert last > 3.0 * first, "it oscillates"
