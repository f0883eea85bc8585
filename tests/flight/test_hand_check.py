"""The verdict on a hand's movements: what explains them, and what to change."""

from __future__ import annotations

from math import cos, pi, radians, sin

import pytest

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, scale
from kybflow.core.signals import NS, Imu, Pose
from kybflow.flight.hand_check.motions import HandMotion, HandStep, HandWatch
from kybflow.flight.hand_check.verdict import DeclaredStream, judge, named_way

UP, X, Y = (0.0, 0.0, 0.3), (0.3, 0.0, 0.0), (0.0, 0.3, 0.0)
NOSE = (0.0, 0.5, 0.0)
NO_IMU = "no IMU is heard"


def carried(step, seen, felt=None):
    return HandMotion(step, seen, felt, 0.0, 0.0, ZERO, None)


def dipped(seen, felt=None):
    return HandMotion(HandStep.DIP, ZERO, None, 0.0, 0.0, seen, felt)


def turned(angle):
    """The rotation vector of a dip at an angle, in degrees, to the left of the nose's."""
    a = radians(angle) + pi / 2
    return (0.5 * cos(a), 0.5 * sin(a), 0.0)


def verdict(lift=UP, x=X, y=Y, dip=NOSE, *, felt=True, felt_dip=NOSE, stream=DeclaredStream()):  # noqa: B008
    """The lines, by what they check. felt: whether an IMU felt what was asked for, or what it felt
    in the lift and the carries."""
    ways = (UP, X, Y) if felt is True else felt or (None, None, None)
    steps = (HandStep.LIFT, HandStep.ALONG_X, HandStep.ALONG_Y)
    motions = [carried(*motion) for motion in zip(steps, (lift, x, y), ways, strict=True)]
    motions.append(dipped(dip, felt_dip if felt else None))
    return {line.check: line for line in judge(motions, stream, None if felt else NO_IMU)}


def red(lines):
    return {check: line.reason for check, line in lines.items() if not line.green}


@pytest.mark.parametrize("felt", [True, False])
def test_what_was_asked_for_is_green(felt):
    assert red(verdict(felt=felt)) == {}


@pytest.mark.parametrize(
    ("factor", "units", "advice"),
    [
        (1e-3, "mm", "the stream is in m; write `units: m` in its sensor"),
        (1e3, "m", "the stream is in mm; write `units: mm` in its sensor"),
        (1e-3, None, "check the stream's `units`"),
        (0.5, "m", "check `units: m` of its sensor, and the cameras' calibration"),
        (1e3, "mm", "check `units: mm` of its sensor, and the cameras' calibration"),
    ],
)
def test_a_wrong_scale_is_told_with_the_units_to_write(factor, units, advice):
    seen = [scale(way, factor) for way in (UP, X, Y)]
    found = red(verdict(*seen, stream=DeclaredStream(units, "z_up")))
    assert found.keys() == {"scale"}
    assert found["scale"].endswith(f": {advice}")


def test_without_an_imu_a_scale_is_judged_by_what_was_asked_for():
    assert red(verdict(*(scale(way, 0.4) for way in (UP, X, Y)), felt=False)) == {}
    found = red(
        verdict(*(scale(way, 1e3) for way in (UP, X, Y)), felt=False, stream=DeclaredStream("m"))
    )
    assert found["scale"].endswith("write `units: mm` in its sensor")


@pytest.mark.parametrize(
    ("seen", "axes", "advice"),
    [
        (((0, -0.3, 0), X, (0, 0, 0.3)), "y_up", "write `axes: z_up` in its sensor"),
        (((0, 0.3, 0), X, (0, 0, -0.3)), "z_up", "write `axes: y_up` in its sensor"),
        (((0, 0.3, 0), X, (0, 0, -0.3)), None, "check its `axes`"),
        ((UP, Y, X), "z_up", "shows x and y exchanged"),
        ((UP, Y, (-0.3, 0, 0)), "z_up", "shows the motion turned by 90 deg"),
        ((UP, (-0.3, 0, 0), (0, -0.3, 0)), "z_up", "shows the motion turned by 180 deg"),
        (((0, 0, -0.3), Y, X), "z_up", "the stream is north-east-down"),
        ((X, Y, UP), "z_up", "shows upward motion along x"),
        ((UP, X, X), "z_up", "repeat the check"),
    ],
)
def test_wrong_axes_are_told_once_with_what_to_change(seen, axes, advice):
    found = red(verdict(*seen, stream=DeclaredStream("m", axes)))
    assert found.pop("nose") == "not judged before the axes are right"
    assert sum(advice in reason for reason in found.values()) == 1


@pytest.mark.parametrize("felt", [True, False])
def test_a_hand_that_is_off_by_thirty_degrees_is_understood(felt):
    a = radians(30.0)
    lift, x = (0.3 * sin(a), 0.0, 0.3 * cos(a)), (0.3 * cos(a), 0.3 * sin(a), 0.0)
    y = (-0.3 * sin(a), 0.3 * cos(a), 0.0)
    ways = (lift, x, y)
    dip = turned(-30.0)
    assert red(verdict(*ways, dip, felt=ways if felt else False, felt_dip=dip)) == {}


@pytest.mark.parametrize("angle", [90, -90, 180])
def test_a_turned_body_is_told_by_the_dip_and_by_the_carries(angle):
    def carry(step, way):
        motion = carried(step, way, way)
        return motion._replace(seen_heading=radians(angle))

    motions = [
        carried(HandStep.LIFT, UP, UP), carry(HandStep.ALONG_X, X), carry(HandStep.ALONG_Y, Y),
        dipped(turned(-angle), NOSE),
    ]  # fmt: skip
    [*_, nose] = judge(motions, DeclaredStream(), None)
    assert not nose.green
    sides = {90: ["left"], -90: ["right"], 180: ["left", "right"]}[angle]
    by_dip, _, by_carries = nose.reason.partition(" of the nose by the dip, ")
    assert any(by_dip.endswith(f"{abs(angle)} deg to the {side}") for side in sides)
    assert any(by_carries.startswith(f"{abs(angle)} deg to the {side}") for side in sides)
    assert nose.reason.endswith("with its x axis along the nose")


def test_a_dip_and_carries_that_contradict_each_other_are_repeated():
    found = red(verdict(dip=turned(-90)))
    assert "contradict each other" in found["nose"]


@pytest.mark.parametrize(
    ("seen", "felt", "words"),
    [(0, 90, "the IMU is mounted turned"), (120, 60, "repeat the check, and dip the nose")],
)
def test_an_imu_that_is_mounted_turned_and_a_wrong_dip_are_no_turned_body(seen, felt, words):
    motions = [carried(HandStep.LIFT, UP), carried(HandStep.ALONG_X, X)]
    motions += [carried(HandStep.ALONG_Y, Y), dipped(turned(seen), turned(felt))]
    [*_, nose] = judge(motions, DeclaredStream(), None)
    assert not nose.green
    assert words in nose.reason


def test_a_hand_that_did_otherwise_is_told_by_the_imu():
    right = (0.0, -0.3, 0.0)
    found = red(verdict(y=right, felt=(UP, X, right)))
    assert "-90 deg to the left of the first carry" in found["y axis"]
    aside = (0.3, 0.0, 0.05)
    found = red(verdict(lift=aside, felt=(aside, X, Y)))
    assert "it was not lifted" in found["up axis"]


def test_steps_that_were_not_seen_are_red():
    lines = judge([carried(HandStep.LIFT, UP)], DeclaredStream(), NO_IMU)
    assert [line.green for line in lines] == [True, True, False, False, False]
    assert all("not judged" in line.reason for line in lines[2:])
    assert not any(line.green for line in judge([], DeclaredStream(), NO_IMU))


@pytest.mark.parametrize(
    ("way", "words"),
    [
        ((0.0, 0.02, 0.31), "31 cm up"),
        ((0.0, 0.0, -0.0003), "0.3 mm down"),
        ((0.0, -300.0, 1.0), "300 m along -y"),
    ],
)
def test_a_way_in_words(way, words):
    assert named_way(way) == words


@pytest.mark.parametrize(
    ("rate", "force", "trouble"),
    [
        (100, 9.8, None),
        (10, 9.8, "the IMU is heard at 10 Hz only, 22 Hz are needed"),
        (100, 1.0, "the IMU at rest shows 1.0 m/s^2 instead of 9.81"),
        (0, 9.8, NO_IMU),
    ],
)
def test_an_imu_that_cannot_be_used_is_told_after_a_while(rate, force, trouble):
    watch, rested = HandWatch(), None
    for k in range(600):
        time = k * NS // 100
        if rate and k % (100 // rate) == 0:
            watch.add_imu(Imu(time, 1.0 / rate, (0.0, 0.0, force), ZERO))
        if watch.add_pose(Pose(time, (0.0005 * (k % 2), 0.0, 0.0), LEVEL)):
            rested = time / NS
            break
    assert rested == pytest.approx(1.5 if trouble is None else 5.0, abs=0.3)
    assert watch.imu_trouble == trouble


@pytest.mark.thorough
def test_a_gyroscope_that_drifts_while_the_person_waits_does_not_tilt_the_lift():
    """The vehicle is lifted 50 s after its rest, with a rate that is off by 0.01 rad/s since."""
    watch, dt = HandWatch(), 0.02

    def height(t):
        s = min(1.0, max(0.0, t - 52.0))
        return 0.3 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)

    for k in range(1, round(55.0 / dt)):
        t, now = k * dt, round(k * dt * NS)
        force = GRAVITY + (height(t) + height(t - 2 * dt) - 2.0 * height(t - dt)) / dt**2
        drift = 0.01 if t > 2.0 else 0.0
        watch.add_imu(Imu(now, dt, (0.0, 0.0, force), (drift, 0.0, 0.0)))
        if watch.add_pose(Pose(now, (0.0, 0.0, height(t)), LEVEL)) and watch.motions:
            break
    [lift] = watch.motions
    assert lift.felt == pytest.approx((0.0, 0.0, 0.3), abs=0.02)
