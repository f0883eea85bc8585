"""A pilot's transmitter as an input."""

from __future__ import annotations

import pytest

from kybflow.core.signals import Sticks
from kybflow.inputs.sticks import SticksInput, SticksInputParams
from kybflow.parts import InputLink


def link(said: list[Sticks], **own: float) -> InputLink:
    params = SticksInputParams(vehicle="a", **own)
    return SticksInput.open(params, lambda name: said[-1] if said and name == "a" else None)


def test_there_is_nothing_before_the_vehicle_reports_any() -> None:
    assert link([]).read(5) is None


def test_the_sticks_are_axes_and_switches_are_buttons() -> None:
    said = [Sticks(7, 0.5, 1.0, -0.25, 0.75, (-1.0, 0.0, 1.0))]
    reading = link(said, dead_zone=0.0).read(9)
    assert reading is not None
    assert reading.heard == 7
    assert reading.axes == {"x": 1.0, "y": -0.5, "z": 0.5, "turn": -0.25}
    assert {"switch3"} == reading.held


def test_it_is_as_old_as_what_was_reported() -> None:
    said = [Sticks(7, 0.0, 0.0, 0.0, 0.5)]
    opened = link(said)
    first = opened.read(9)
    assert first is opened.read(500)
    said.append(Sticks(400, 0.0, 0.5, 0.0, 0.5))
    later = opened.read(500)
    assert later is not None
    assert later.heard == 400
    assert pytest.approx((0.5 - 0.08) / 0.92) == later.axes["x"]
