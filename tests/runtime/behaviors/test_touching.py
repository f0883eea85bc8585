"""Touching a surface, pushing it and letting go: gently, as hard as asked, and never for longer
than contact lasts."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, sin, tan

import pytest
from part_bench import BLOCK, DT, MASS, WITH_BLOCK, entry, estimate, seen_block

from kybflow.core.geometry import GRAVITY, Vec3
from kybflow.core.signals import NS, Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.runtime.behaviors.approach_contact import ApproachContact, ApproachContactParams
from kybflow.runtime.behaviors.go_round import GoRound, GoRoundParams
from kybflow.runtime.behaviors.hover import Hover, HoverParams
from kybflow.runtime.behaviors.let_go import LetGo, LetGoParams
from kybflow.runtime.behaviors.push import PushBehavior, PushBehaviorParams

REACH = 0.12
AIRFRAME = replace(WITH_BLOCK.airframe, bumper=REACH)
CONTEXT = WITH_BLOCK._replace(airframe=AIRFRAME)
FACE = 0.9
"""Where the surface is, along x."""
IN_TOUCH: Vec3 = (FACE - REACH, 0.2, 1.0)


def tick(
    elapsed: float, position: Vec3, velocity: Vec3 = (0.0, 0.0, 0.0), q: float = 0.0,
    speed: float = 0.0, age: float = 0.0, lean: float = 0.0,
) -> Tick:  # fmt: skip
    """lean: the acceleration along x that the tilt gives."""
    now = round(elapsed * NS)
    seen = seen_block(q, speed, now - round(age * NS))
    tilted = (cos(atan(lean / GRAVITY) / 2.0), 0.0, sin(atan(lean / GRAVITY) / 2.0), 0.0)
    known = estimate(position, velocity, now)._replace(attitude=tilted)
    return Tick(now, DT, elapsed, known, None, None, {}, objects=seen)


def pushed(behavior: PushBehavior, seconds: float, short: float = 0.0, **more: float) -> float:
    """Push, at rest, with a tilt that follows the setpoint but for `short`; return its acceleration
    at the end. more: the share, or where the object is."""
    x, y, z = IN_TOUCH
    share, lean = more.get("share"), 0.0
    for i in range(round(seconds / DT)):
        now = tick(i * DT, (x + more.get("q", 0.0), y, z), q=more.get("q", 0.0), lean=lean - short)
        given = behavior.update(now._replace(share=share))
        assert isinstance(given, Setpoint)
        assert given.acceleration is not None
        lean = given.acceleration[0]
    return lean


def pushing(force: float = 0.1, speed: float = 0.2, q: float = 0.0) -> PushBehavior:
    """A vehicle that has pushed for a second."""
    behavior = PushBehavior(
        PushBehaviorParams(surface="block.back", force=force, speed=speed),
        entry(IN_TOUCH, context=CONTEXT),
    )
    pushed(behavior, 1.0, q=q)
    return behavior


def test_it_presses_as_hard_as_asked_and_no_harder_than_a_moving_object_needs() -> None:
    given = pushing(0.1).update(tick(1.0, IN_TOUCH, lean=0.1 / MASS))
    assert isinstance(given, Setpoint)
    assert given.kind is SetpointKind.VELOCITY
    assert given.acceleration == pytest.approx((0.1 / MASS, 0.0, 0.0), rel=0.03)
    assert given.presses == pytest.approx((1.0, 0.0, 0.0))
    moving = pushing(0.1).update(tick(1.0, IN_TOUCH, (0.2, 0.0, 0.0), speed=0.2))
    assert isinstance(moving, Setpoint)
    assert moving.acceleration == pytest.approx((0.0, 0.0, 0.0))
    assert moving.velocity == pytest.approx((0.2, 0.0, 0.0))


@pytest.mark.parametrize("short", [0.2, -0.2])
def test_a_tilt_that_friction_holds_back_is_corrected(short: float) -> None:
    params = PushBehaviorParams(surface="block.back", force=0.2)
    behavior = PushBehavior(params, entry(IN_TOUCH, context=CONTEXT))
    assert pushed(behavior, 6.0, short) - short == pytest.approx(0.2 / MASS, rel=0.02)


def test_without_a_force_it_presses_as_the_coordinator_says_and_lets_go_without_one() -> None:
    params = PushBehaviorParams(surface="block.back")
    behavior = PushBehavior(params, entry(IN_TOUCH, context=CONTEXT))
    assert pushed(behavior, 1.0, share=0.1) == pytest.approx(0.1 / MASS, rel=0.03)
    failed = behavior.update(tick(1.0, IN_TOUCH))
    assert isinstance(failed, Failed)
    assert failed.reason == "no coordinator gives it a force"
    assert failed.setpoint.presses is None


def test_it_goes_back_to_the_middle_of_the_surface() -> None:
    x, _, _ = IN_TOUCH
    given = pushing().update(tick(1.0, (x, 0.25, 0.96)))
    assert isinstance(given, Setpoint)
    assert given.velocity is not None
    _, vy, vz = given.velocity
    assert vy < 0.0 < vz


@pytest.mark.parametrize("why", ["apart", "aside"])
def test_it_lets_go_within_a_fifth_of_a_second_when_contact_breaks(why: str) -> None:
    behavior, (x, y, z) = pushing(), IN_TOUCH
    away = (x - 0.06, y, z) if why == "apart" else (x, y + 0.3, z)
    outputs = [behavior.update(tick(1.0 + i * DT, away)) for i in range(round(0.2 / DT))]
    failed = next(one for one in outputs if isinstance(one, Failed))
    assert "lost contact with `block.back`" in failed.reason
    assert failed.setpoint.presses is None
    assert failed.setpoint.acceleration == pytest.approx((0.0, 0.0, 0.0))


def test_it_lets_go_when_the_object_is_not_seen_any_more() -> None:
    behavior = pushing()
    assert isinstance(behavior.update(tick(1.1, IN_TOUCH, age=0.15)), Setpoint)
    failed = behavior.update(tick(1.2, IN_TOUCH, age=0.21))
    assert isinstance(failed, Failed)
    assert "last seen 0.2 s ago" in failed.reason


def test_it_fails_without_contact_and_without_an_object() -> None:
    params = PushBehaviorParams(surface="block.back", force=0.25)
    behavior = PushBehavior(params, entry((0.0, 0.2, 1.0), context=CONTEXT))
    assert isinstance(behavior.update(tick(0.9, (0.0, 0.2, 1.0))), Setpoint)
    failed = behavior.update(tick(1.1, (0.0, 0.2, 1.0)))
    assert isinstance(failed, Failed)
    assert "doesn't touch" in failed.reason
    unseen = PushBehavior(params, entry(IN_TOUCH, context=CONTEXT))
    failed = unseen.update(tick(0.0, IN_TOUCH)._replace(objects={}))
    assert isinstance(failed, Failed)
    assert failed.reason == "`block` has not been seen"


def test_it_fails_if_what_it_pushes_does_not_move() -> None:
    params = PushBehaviorParams(surface="block.back", force=0.25, patience=3.0)
    behavior = PushBehavior(params, entry(IN_TOUCH, context=CONTEXT))
    x, y, z = IN_TOUCH
    outputs = []
    for i in range(round(7.0 / DT)):
        q = min(0.2, 0.05 * i * DT)  # it moves for four seconds
        outputs.append(behavior.update(tick(i * DT, (x + q, y, z), q=q)))
    [first, *_] = [i * DT for i, one in enumerate(outputs) if isinstance(one, Failed)]
    assert first == pytest.approx(7.0, abs=0.25)


def test_it_is_done_at_the_stop() -> None:
    x, y, z = IN_TOUCH
    done = pushing(q=0.9).update(tick(1.0, (x + 0.995, y, z), q=0.995))
    assert isinstance(done, Done)
    assert done.setpoint.presses is None


def test_no_force_is_larger_than_the_tilt_allows() -> None:
    most = MASS * GRAVITY * tan(AIRFRAME.tilt)
    params = PushBehaviorParams(surface="block.back", force=1.01 * most)
    [found] = PushBehavior.objections(params, CONTEXT)
    assert found.parameter == "force"
    assert not [*PushBehavior.objections(replace(params, force=0.99 * most), CONTEXT)]


@pytest.mark.parametrize(
    ("surface", "reason"),
    [("block.front", "no surface"), ("blok.back", "no surface"), ("block", "no surface")],
)
def test_a_surface_must_exist(surface: str, reason: str) -> None:
    [found] = LetGo.objections(LetGoParams(surface=surface), CONTEXT)
    assert reason in found.reason
    assert "block.back" in found.hint


def test_it_needs_a_bumper_and_an_object_that_moves() -> None:
    [found] = LetGo.objections(LetGoParams(surface="block.back"), WITH_BLOCK)
    assert "without a `bumper`" in found.reason
    part = BLOCK._replace(name="plate", on="block", joint=None)
    context = CONTEXT._replace(objects={"block": BLOCK, "plate": part})
    [found] = LetGo.objections(LetGoParams(surface="plate.back"), context)
    assert "a part of `block`" in found.reason


def test_it_approaches_slower_and_slower_until_it_touches() -> None:
    params = ApproachContactParams(surface="block.back", distance=0.3)
    x, y, z = (FACE - REACH - 0.3, 0.2, 1.0)
    behavior = ApproachContact(params, entry((x, y, z), context=CONTEXT))
    speeds, elapsed, touched = [], 0.0, 0.0
    for _ in range(round(20.0 / DT)):
        output = behavior.update(
            tick(elapsed, (x, y, z), (speeds[-1] if speeds else 0.0, 0.0, 0.0))
        )
        elapsed += DT
        if isinstance(output, Done):
            break
        assert isinstance(output, Setpoint)
        assert output.velocity is not None
        stands = x >= FACE - REACH
        touched = touched + DT if stands else 0.0
        speeds.append(0.0 if stands else output.velocity[0])
        x = min(FACE - REACH, x + output.velocity[0] * DT)
    assert x == pytest.approx(FACE - REACH)
    assert touched == pytest.approx(0.1, abs=0.02)
    assert max(speeds) <= 0.25
    assert [s for s in speeds if s][-1] == pytest.approx(0.06, abs=0.01)


def test_it_does_not_touch_from_behind() -> None:
    params = ApproachContactParams(surface="block.back")
    behavior = ApproachContact(params, entry((1.5, 0.2, 1.0), context=CONTEXT))
    failed = behavior.update(tick(0.0, (1.5, 0.2, 1.0)))
    assert isinstance(failed, Failed)
    assert "not in front" in failed.reason


def test_it_flies_back_out_of_the_surface() -> None:
    behavior = LetGo(
        LetGoParams(surface="block.back", distance=0.4), entry(IN_TOUCH, context=CONTEXT)
    )
    outputs = [behavior.update(tick(i * DT, IN_TOUCH)) for i in range(round(6.0 / DT))]
    done = next(one for one in outputs if isinstance(one, Done))
    x, y, z = IN_TOUCH
    assert done.setpoint.position == pytest.approx((x - 0.4, y, z))


def test_guards_are_told_what_a_behavior_means_to_touch() -> None:
    surface = "block.back"
    assert ApproachContact.touches(ApproachContactParams(surface=surface)) == "block"
    assert PushBehavior.touches(PushBehaviorParams(surface=surface)) == "block"
    assert LetGo.touches(LetGoParams(surface=surface)) == "block"
    assert GoRound.touches(GoRoundParams(surface=surface)) == ""
    assert Hover.touches(HoverParams()) == ""
