"""The choice of the estimator: the first healthy one, with hysteresis and a bound on its use."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, nan
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plans import FENCE, NANO, part, state, vehicle

from kybflow.core.errors import PartFailed
from kybflow.core.geometry import (
    LEVEL,
    ZERO,
    Vec3,
    add,
    distance,
    from_heading,
    heading_of,
    norm,
    scale,
    sub,
)
from kybflow.core.signals import NS, Estimate, Event
from kybflow.core.units import DURATION
from kybflow.dsl.expressions import Compare, Quantity, Read
from kybflow.dsl.plan import EstimatorPlan, PartPlan
from kybflow.flight.pose_gate import Refusal
from kybflow.parts import Estimator
from kybflow.runtime.events import Events
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.estimation import (
    BLEND_TIME_S,
    DECAY_RATE,
    EstimateBlend,
    Estimation,
    ExternalPosition,
)
from kybflow.world.vehicle_context import VehicleContext

SITE = VehicleContext("a", NANO, ZERO, 0.0, FENCE, 0.1)


@dataclass(frozen=True)
class Named:
    name: str


class Scripted(Estimator[Named]):
    """An estimator whose age is set by the test; None: it has no estimate."""

    needs = frozenset()
    ages: dict[str, float | None] = {}  # noqa: RUF012 (the test sets it)
    places: dict[str, Vec3] = {}  # noqa: RUF012 (the test sets it)

    def __init__(self, params: Named, context: VehicleContext) -> None:
        super().__init__(params, context)
        self.anchors: list[Estimate] = []

    def update(self, measurements, now):
        age = self.ages[self.params.name]
        if age is None:
            return None
        name = self.params.name
        return Estimate(now, self.places.get(name, ZERO), ZERO, LEVEL, ZERO, name, age, 0.0)

    def anchor(self, estimate):
        self.anchors.append(estimate)


def candidate(name: str, recover: float = 1.0, at_most: float | None = None) -> EstimatorPlan:
    part = PartPlan(name, Scripted, Named(name), f"estimators.{name}")
    fresh = Compare("<", Read(None, "estimate.age"), Quantity(0.3, DURATION))
    return EstimatorPlan(part, healthy=fresh, recover_after=recover, for_at_most=at_most)


@pytest.fixture
def ages():
    Scripted.ages = {"first": 0.0, "second": 0.0}
    yield Scripted.ages
    Scripted.ages, Scripted.places = {}, {}


def choice(
    *candidates: EstimatorPlan,
    failed: list[PartFailed] | None = None,
    told: list[Event] | None = None,
    known=lambda kinds: "",
) -> Estimation:
    states = [state("wait", part("behaviors", "wait_on_ground"))]
    events = Events(() if told is None else (told.append,))
    report = [].append if failed is None else failed.append
    plan = vehicle("a", states, estimators=candidates)
    return Estimation(plan, SITE, events, VehicleScore("a"), report, known)


def sources_used(estimation: Estimation, begin: float, end: float) -> list[str | None]:
    """Which source is used at each tenth of a second, without repetitions."""
    used: list[str | None] = []
    for tick in range(round(begin * 10), round(end * 10)):
        estimate = estimation.update((), tick * NS // 10)
        source = estimate.source if estimate else None
        if not used or used[-1] != source:
            used.append(source)
    return used


def test_the_first_healthy_one_is_used(ages):
    estimation = choice(candidate("first"), candidate("second"))
    assert sources_used(estimation, 0.0, 1.0) == ["first"]
    ages["first"] = 0.4
    assert sources_used(estimation, 1.0, 2.0) == ["second"]
    ages["second"] = None
    assert sources_used(estimation, 2.0, 3.0) == [None]


def test_one_that_was_lost_counts_again_only_after_its_time(ages):
    estimation = choice(candidate("first"), candidate("second"))
    sources_used(estimation, 0.0, 1.0)
    ages["first"] = 0.4
    sources_used(estimation, 1.0, 2.0)
    ages["first"] = 0.0
    assert sources_used(estimation, 2.0, 2.9) == ["second"]
    ages["first"] = 0.4
    sources_used(estimation, 2.9, 3.0)
    ages["first"] = 0.0
    assert sources_used(estimation, 3.0, 3.9) == ["second"]
    assert sources_used(estimation, 3.9, 4.5) == ["second", "first"]


def test_at_the_start_nobody_waits(ages):
    assert sources_used(choice(candidate("first", recover=9.0)), 0.0, 0.1) == ["first"]


def test_one_that_may_be_used_for_a_time_only_is_spent_until_another_was_used(ages):
    estimation = choice(candidate("first"), candidate("second", at_most=2.0))
    ages["first"] = 0.4
    assert sources_used(estimation, 0.0, 2.0) == ["second"]
    assert sources_used(estimation, 2.0, 9.0) == [None]
    ages["first"] = 0.0
    assert sources_used(estimation, 9.0, 11.0) == ["first"]
    ages["first"] = 0.4
    assert sources_used(estimation, 11.0, 12.0) == ["second"]


def test_a_moment_of_another_does_not_renew_one_that_is_spent(ages):
    estimation = choice(candidate("first"), candidate("second", at_most=2.0))
    ages["first"] = 0.4
    sources_used(estimation, 0.0, 2.0)
    ages["first"] = 0.0
    assert sources_used(estimation, 2.0, 3.0) == ["first"]
    ages["first"] = 0.4
    assert sources_used(estimation, 3.0, 4.0) == [None]


def test_the_time_of_use_adds_up_over_short_uses(ages):
    estimation = choice(candidate("first", recover=0.0), candidate("second", at_most=2.0))
    used = []
    for tick in range(100):
        ages["first"] = 0.0 if tick % 4 == 0 else 0.4
        used.append(sources_used(estimation, tick / 10, (tick + 1) / 10)[0])
    spent = used.index(None)
    assert 30 <= spent <= 45
    assert "second" not in used[spent:]


def test_one_that_has_just_become_healthy_is_better_than_none(ages):
    estimation = choice(candidate("first", recover=1.0), candidate("second", at_most=2.0))
    sources_used(estimation, 0.0, 0.5)
    ages["first"] = 0.4
    sources_used(estimation, 0.5, 2.0)
    ages["first"] = 0.0
    assert sources_used(estimation, 2.0, 2.5) == ["second"]
    assert sources_used(estimation, 2.5, 2.7) == ["first"]
    ages["second"], ages["first"] = None, 0.4
    assert sources_used(estimation, 2.7, 3.0) == [None]
    ages["first"] = 0.0
    assert sources_used(estimation, 3.0, 3.1) == ["first"]


def recovering(ages, second: Vec3) -> Estimation:
    """A second after the first was lost, it is back and says that the vehicle is at zero; the
    second one, flown on meanwhile, has it at `second`."""
    estimation = choice(candidate("first", recover=5.0), candidate("second"))
    Scripted.places, ages["first"] = {}, 0.0
    sources_used(estimation, 0.0, 1.0)
    ages["first"] = 1.0
    sources_used(estimation, 1.0, 2.0)
    Scripted.places = {"second": second}
    ages["first"] = 0.0
    return estimation


def test_one_that_contradicts_what_is_flown_on_does_not_wait_and_stays(ages):
    """0.3 m: from there on the estimate would step at the change in any case."""
    agreeing = recovering(ages, (0.29, 0.0, 0.0))
    assert sources_used(agreeing, 2.0, 3.0) == ["second"]
    contradicted = recovering(ages, (0.31, 0.0, 0.0))
    assert sources_used(contradicted, 2.0, 2.1) == ["second"]
    assert sources_used(contradicted, 2.1, 3.0) == ["first"]


def test_what_an_estimator_refuses_is_told_and_when_it_takes_it_again(ages):
    told: list[Event] = []
    estimation = choice(candidate("first"), told=told)
    sources_used(estimation, 0.0, 0.1)
    [only] = estimation.candidates
    only.part.refusal = Refusal(NS // 2, "1.20 m from the estimate, 0.50 m allowed")
    sources_used(estimation, 0.7, 0.9)
    only.part.refusal = None
    sources_used(estimation, 2.5, 2.6)
    told = [e for e in told if e.name.startswith("position_")]
    assert [(e.name, e.fields) for e in told] == [
        (
            "position_refused",
            {
                "estimator": "first",
                "reason": "1.20 m from the estimate, 0.50 m allowed",
            },
        ),
        ("position_accepted", {"estimator": "first", "value": pytest.approx(2.0)}),
    ]


def test_the_others_are_told_what_is_flown_on(ages):
    estimation = choice(candidate("first"), candidate("second"))
    sources_used(estimation, 0.0, 1.0)
    first, second = estimation.parts().values()
    assert first.anchors == []
    assert {e.source for e in second.anchors} == {"first"}
    assert len(second.anchors) == 10
    ages["first"] = ages["second"] = None
    sources_used(estimation, 1.0, 2.0)
    assert len(second.anchors) == 10


def test_one_that_fails_when_it_is_anchored_is_left_out(ages):
    failed: list[PartFailed] = []
    estimation = choice(candidate("first"), candidate("second"), failed=failed)
    estimation.parts()["estimators.second"].anchors = None
    assert sources_used(estimation, 0.0, 1.0) == ["first"]
    assert [failure.part for failure in failed] == ["estimators.second"]


def test_a_change_is_told_with_its_reason_and_its_offset(ages):
    told: list[Event] = []
    estimation = choice(candidate("first"), candidate("second", at_most=1.0), told=told)
    sources_used(estimation, 0.0, 1.0)
    ages["first"] = 0.4
    Scripted.places = {"second": (0.1, 0.0, 0.0)}
    sources_used(estimation, 1.0, 3.0)
    ages["first"] = 0.0
    sources_used(estimation, 3.0, 4.0)
    assert [(e.name, e.fields["reason"]) for e in told] == [
        ("estimator_changed", "the first estimate"),
        ("estimator_changed", "`first` is not healthy: age 0.400 s, spread 0.000 m"),
        ("estimator_lost", "`second` may be used for 1 s at most"),
        ("estimator_changed", "there was none"),
    ]
    assert told[1].fields["offset"] == pytest.approx(0.1)
    assert told[1].fields["blended"] is True


def test_at_a_change_the_position_goes_on_without_a_step(ages):
    estimation = choice(candidate("first"), candidate("second"))
    sources_used(estimation, 0.0, 1.0)
    ages["first"] = 0.4
    Scripted.places = {"second": (0.2, 0.0, 0.0)}
    xs = [estimation.update((), tick * NS // 100).position[0] for tick in range(100, 900)]
    assert xs[0] == pytest.approx(0.0, abs=1e-9)
    assert max(b - a for a, b in pairwise(xs)) < 0.2 * 0.56 / 100
    assert xs == sorted(xs)
    assert xs[-1] == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize("broken", [nan, "no number"])
def test_one_that_fails_is_reported_once_and_the_next_is_used(ages, broken):
    failed: list[PartFailed] = []
    told: list[Event] = []
    estimation = choice(candidate("first"), candidate("second"), failed=failed, told=told)
    sources_used(estimation, 0.0, 1.0)
    ages["first"] = broken
    assert sources_used(estimation, 1.0, 2.0) == ["second"]
    ages["first"] = 0.0
    assert sources_used(estimation, 2.0, 9.0) == ["second"]
    assert [failure.part for failure in failed] == ["estimators.first"]
    ages["second"] = broken
    assert sources_used(estimation, 9.0, 10.0) == [None]
    assert [(e.name, e.fields["previous"]) for e in told] == [
        ("estimator_changed", None), ("estimator_changed", "first"), ("estimator_lost", "second"),
    ]  # fmt: skip


def test_a_behavior_brings_others_to_the_front_and_the_next_one_takes_them_back(ages):
    told: list[Event] = []
    three = (candidate("first"), candidate("second"), candidate("third"))
    ages["third"] = 0.0
    estimation = choice(*three, told=told)
    assert sources_used(estimation, 0.0, 1.0) == ["first"]
    estimation.prefer(("third", "second"))
    assert sources_used(estimation, 1.0, 2.0) == ["third"]
    ages["third"] = None
    assert sources_used(estimation, 2.0, 3.0) == ["second"]
    ages["second"] = None
    assert sources_used(estimation, 3.0, 4.0) == ["first"], (
        "the others come behind, in their own order"
    )
    ages["second"] = 0.0
    assert sources_used(estimation, 4.0, 6.0) == ["first", "second"]
    estimation.prefer(())
    assert sources_used(estimation, 6.0, 7.0) == ["first"]
    reasons = [event.fields["reason"] for event in told]
    assert reasons[1] == "`third` comes first in this behavior"
    assert reasons[-2:] == ["`second` is healthy again", "`first` comes first again"]


def test_nothing_is_told_where_the_order_changes_nothing(ages):
    told: list[Event] = []
    estimation = choice(candidate("first"), candidate("second"), told=told)
    sources_used(estimation, 0.0, 1.0)
    estimation.prefer(("first",))
    sources_used(estimation, 1.0, 2.0)
    estimation.prefer(("first", "second"))
    sources_used(estimation, 2.0, 3.0)
    assert [event.name for event in told] == ["estimator_changed"]


def test_one_that_failed_is_not_brought_back_by_a_behavior(ages):
    estimation = choice(candidate("first"), candidate("second"))
    sources_used(estimation, 0.0, 1.0)
    del ages["second"]
    sources_used(estimation, 1.0, 1.1)
    ages["second"] = 0.0
    estimation.prefer(("second",))
    assert sources_used(estimation, 1.1, 2.0) == ["first"]


def test_the_reason_says_what_is_known_of_what_it_lives_on(ages):
    told: list[Event] = []
    asked = []

    def known(kinds):
        asked.append(kinds)
        return "the camera `down` froze"

    estimation = choice(candidate("first"), candidate("second"), told=told, known=known)
    sources_used(estimation, 0.0, 1.0)
    assert asked == [], "nothing was wrong"
    ages["first"] = 0.4
    sources_used(estimation, 1.0, 2.0)
    why = "`first` is not healthy: age 0.400 s, spread 0.000 m; the camera `down` froze"
    assert told[-1].fields["reason"] == why
    assert asked == [Scripted.needs]
    ages["first"] = 0.0
    sources_used(estimation, 2.0, 4.0)
    assert told[-1].fields["reason"] == "`first` is healthy again"


def test_one_that_failed_needs_no_other_reason(ages):
    told: list[Event] = []
    estimation = choice(
        candidate("first"), candidate("second"), told=told, known=lambda kinds: "it rained"
    )
    sources_used(estimation, 0.0, 1.0)
    estimation.kill(frozenset({"first"}))
    sources_used(estimation, 1.0, 2.0)
    assert told[-1].fields["reason"] == "`first` failed"


TICK = NS // 250


def at(now, position, velocity=ZERO, heading=0.0, source="a"):
    attitude = from_heading(heading)
    return Estimate(now, position, velocity, attitude, ZERO, source, 0.0, 0.001)


def small(most):
    return st.tuples(*[st.floats(-most, most)] * 3)


@given(small(0.15), small(0.25), st.floats(-0.3, 0.3))
def test_the_output_goes_on_where_and_as_fast_as_the_last_one(position, velocity, heading):
    last = at(0, (1.0, 2.0, 1.0), (0.1, 0.0, 0.2), 0.4)
    new = at(TICK, sub(last.position, position), sub(last.velocity, velocity), 0.4 - heading)
    _, blend = EstimateBlend.between(last, new)
    out = blend.applied(new)
    assert out.position == pytest.approx(add(last.position, scale(last.velocity, TICK / NS)))
    assert out.velocity == pytest.approx(last.velocity)
    assert heading_of(out.attitude) == pytest.approx(0.4)
    assert (out.source, out.age, out.spread) == (new.source, new.age, new.spread)


@pytest.mark.thorough
@given(small(0.15), small(0.25))
def test_its_velocity_is_the_derivative_of_its_position_and_it_ends(position, velocity):
    _, blend = EstimateBlend.between(at(0, position, velocity), at(0, ZERO))
    for now in range(0, 6 * NS, NS // 4):
        before, here, after = (
            blend.applied(at(t, ZERO)) for t in (now, now + TICK, now + 2 * TICK)
        )
        slope = scale(sub(after.position, before.position), 0.5 * NS / TICK)
        assert here.velocity == pytest.approx(slope, abs=1e-4)
    end = round(BLEND_TIME_S * NS)
    assert norm(blend.applied(at(end, ZERO)).position) < 5e-5
    assert not blend.is_over(end - 1)
    assert blend.is_over(end + TICK)


def test_it_never_moves_faster_than_its_page_says():
    _, blend = EstimateBlend.between(at(0, (0.3, 0.0, 0.0)), at(0, ZERO))
    speeds = [norm(blend.applied(at(t, ZERO)).velocity) for t in range(0, 8 * NS, TICK)]
    assert max(speeds) == pytest.approx(0.3 * DECAY_RATE / exp(1.0), rel=1e-3)


@pytest.mark.parametrize(
    "last", [at(0, (0.31, 0.0, 0.0)), at(0, (0.1, 0.0, 0.0), heading=0.4)], ids=["far", "turned"]
)
def test_an_output_that_was_wrong_is_left_at_once(last):
    offset, blend = EstimateBlend.between(last, at(TICK, ZERO))
    assert blend is None
    assert offset == pytest.approx(distance(last.position, ZERO))


def test_a_velocity_that_was_noise_counts_no_more():
    _, blend = EstimateBlend.between(at(0, (0.1, 0.0, 0.0), (0.9, 0.0, 0.0)), at(0, ZERO))
    out = blend.applied(at(0, ZERO))
    assert out.position == pytest.approx((0.1, 0.0, 0.0))
    assert out.velocity == pytest.approx(ZERO)


def test_the_tracking_of_the_largest_offset_is_never_two_centimetres_off():
    """TeleKyb's law (9.0, 7.5) on a point mass that believes the blended estimate."""
    _, blend = EstimateBlend.between(at(0, (0.3, 0.0, 0.0)), at(0, ZERO))
    x = v = worst = 0.0
    for now in range(0, 8 * NS, TICK):
        told = blend.applied(at(now, (x - 0.3, 0.0, 0.0), (v, 0.0, 0.0)))
        error = -told.position[0]
        worst = max(worst, abs(error))
        v += (9.0 * error - 7.5 * told.velocity[0]) * TICK / NS
        x += v * TICK / NS
    assert worst < 0.02
    assert x == pytest.approx(0.3, abs=0.005)


class Believed:
    """The estimators of a vehicle: which one is in use, and which can be."""

    def __init__(self, *names: str) -> None:
        self.names, self.source, self.usable = names, names[0], set(names)

    @property
    def candidates(self) -> list[Any]:
        return [
            SimpleNamespace(name=name, is_usable=name in self.usable, estimate=estimate(name))
            for name in self.names
        ]


def estimate(source: str) -> Estimate:
    return Estimate(0, ZERO, ZERO, LEVEL, ZERO, source, 0.0, 0.01)


def telling(*parts: tuple[str, str]) -> tuple[ExternalPosition, Believed]:
    """Of estimators with these names in the mission, each of a part."""
    plans = [
        SimpleNamespace(part=replace(part("estimators", use), label=f"estimators.{name}"))
        for name, use in parts
    ]
    believed = Believed(*(name for name, _ in parts))
    return ExternalPosition(SimpleNamespace(estimators=plans), believed), believed  # type: ignore[arg-type]


def told(tells: ExternalPosition, believed: Believed, source: str | None) -> str | None:
    believed.source = source  # type: ignore[assignment]
    found = tells.of(None if source is None else estimate(source))
    return None if found is None else found.source


def test_its_own_estimate_is_not_told_to_it_under_another_name():
    tells, believed = telling(("on_board", "autopilot"))
    assert told(tells, believed, "on_board") is None


def test_one_that_flies_on_its_own_estimate_is_still_told_of_another():
    tells, believed = telling(("autopilot", "autopilot"), ("mocap", "mocap"))
    assert told(tells, believed, "autopilot") == "mocap"
    believed.usable.discard("mocap")
    assert told(tells, believed, "autopilot") is None


@pytest.mark.parametrize(("before", "is_told"), [("mocap", True), ("autopilot", False)])
def test_dead_reckoning_is_told_where_what_it_began_from_was_from_outside(before, is_told):
    tells, believed = telling(
        ("mocap", "mocap"), ("autopilot", "autopilot"), ("inertial", "inertial")
    )
    believed.usable.discard("mocap")
    assert told(tells, believed, before) == (before if is_told else None)
    assert told(tells, believed, "inertial") == ("inertial" if is_told else None)
    assert told(tells, believed, None) is None
    assert told(tells, believed, "inertial") == ("inertial" if is_told else None)
    believed.usable.add("mocap")
    assert told(tells, believed, "mocap") == "mocap"
    assert told(tells, believed, "inertial") == "inertial"
