"""hover: holds the point and the heading of entry; comes to rest there when it was moving."""

import pytest
from part_bench import DT, entry, fastest, fly, hardest, ideal, worst_mismatch

from kybflow.core.signals import Done
from kybflow.runtime.behaviors.hover import Hover, HoverParams

START = (0.5, -0.2, 1.0)


def test_it_holds_where_it_was_entered_for_as_long_as_it_is_let() -> None:
    flown = fly(Hover(HoverParams(), entry(START)), ideal(START), seconds=2.0)
    assert flown.end is None
    assert {s.setpoint.position for s in flown.samples} == {START}
    assert fastest(flown.samples) == 0.0


def test_it_is_done_after_its_time() -> None:
    flown = fly(Hover(HoverParams(for_time=1.0), entry(START)), ideal(START))
    assert isinstance(flown.end, Done)
    assert flown.duration == pytest.approx(1.0, abs=DT)


def test_entered_fast_it_stops_first_without_a_step() -> None:
    behavior = Hover(HoverParams(for_time=0.5), entry(START, (1.0, 0.0, 0.0)))
    flown = fly(behavior, ideal(START))
    assert flown.samples[0].setpoint.velocity == (1.0, 0.0, 0.0)
    assert hardest(flown.samples) <= 1.5 + 1e-9
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-4
    assert isinstance(flown.end, Done)
    assert flown.end.setpoint.velocity == (0.0, 0.0, 0.0)
