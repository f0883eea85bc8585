"""Processors that retune the tracker: by the way of every other change of an option, and told."""

from __future__ import annotations

from typing import Any

import pytest
from plans import part, vehicle
from short_flights import NoParams, down, hold, named, up

from kybflow.core.signals import NS, Retune, Setpoint, SetpointKind, Tick
from kybflow.dsl.plan import PartPlan
from kybflow.parts import Processor

SECOND = 1.0
GAIN = "a.trackers.cascade.derivative"


class Stiffen(Processor[Any]):
    """Asks for `wanted` when the behavior has lasted for a second."""

    accepts = {SetpointKind.POSITION: SetpointKind.POSITION}  # noqa: RUF012
    retunes = frozenset({"derivative", "mass_guess"})
    wanted: dict[str, float] = {}  # noqa: RUF012

    def __init__(self, params: Any, context: Any) -> None:
        super().__init__(params, context)
        self._asked = False

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Retune:
        if self._asked or tick.elapsed < SECOND:
            return setpoint
        self._asked = True
        return Retune(setpoint, self.wanted)


def retuned(run: Any, wanted: dict[str, float]) -> tuple[list[Any], list[float]]:
    """What was told, and the tracker's derivative gain as it was seen 20 times a second."""
    cls = type("Stiffen", (Stiffen,), {"wanted": wanted})
    stiffen = PartPlan("stiffen", cls, NoParams(), "processors.stiffen", "m.yaml:5")
    a = vehicle(
        "a",
        [up("hold"), hold(2.0, "down"), down()],
        processors=(part("processors", "fence"), stiffen),
    )
    seen: list[float] = []
    _, told = run(a, observers=(lambda e: seen.append(e.options.get(GAIN)),))
    return told, seen


def test_it_takes_effect_in_the_next_tick_and_names_who_asked(run: Any) -> None:
    told, seen = retuned(run, {"derivative": 9.0})
    [changed] = named(told, "option_changed")
    assert changed.fields == {
        "option": GAIN,
        "value": "9.0",
        "by": "processor stiffen",
    }
    assert (changed.vehicle, changed.at) == ("a", "m.yaml:5")
    held = next(e for e in named(told, "behavior_started") if e.fields["behavior"] == "hold")
    assert changed.time - held.time == pytest.approx(NS + NS // 250, abs=2)
    assert (seen[0], seen[-1]) == (7.5, 9.0)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("wanted", "reason"),
    [
        ({"derivative": -1.0}, "must be above 0"),
        ({"derivative": float("nan")}, "`nan` is not a number"),
        ({"mass_guess": 1.2}, "is read-only"),
    ],
)
def test_what_is_out_of_bounds_is_refused_and_told(
    run: Any, wanted: dict[str, float], reason: str
) -> None:
    told, seen = retuned(run, wanted)
    [refused] = named(told, "option_refused")
    assert reason in str(refused.fields["reason"])
    assert refused.fields["by"] == "processor stiffen"
    assert not named(told, "part_failed")
    assert {*seen} == {7.5}


def test_one_that_retunes_what_it_does_not_declare_has_failed(run: Any) -> None:
    told, seen = retuned(run, {"tilt": 0.1})
    [failed] = named(told, "part_failed")
    assert failed.fields["part"] == "processors.stiffen"
    assert "`tilt` is not among its declared options" in str(failed.fields["reason"])
    assert {*seen} == {7.5}
