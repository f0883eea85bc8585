"""Judges by a hand's movements whether motion capture shows the declared frame.

- Scale: the lengths of the movements by the poses, relative to those by the IMU.
- Axes: the axis of the poses that is nearest to each movement. The lift, and the carries along +x
  and +y, must be seen along z, x and y. The hand may be off by up to 45 degrees.
- Heading of the body: the axis about which the nose was dipped, by the poses and by the
  accelerometer, both in body axes. A body that is defined turned to the left by an angle shows this
  axis turned to the right by that angle. The carries, relative to the heading, show the same.

Without an IMU, lengths are compared with what was asked for, and the nose with the person's word.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, degrees, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import Vec3, norm, wrap
from kybflow.core.units import DEG
from kybflow.flight.frame_check import axes_words
from kybflow.flight.hand_check.motions import HandMotion, HandStep, nearest_axis

MIN_SCALE, MAX_SCALE = 0.7, 1.4
"""Bounds of the poses' scale by the IMU."""
ASKED_WAY, LEAST_SEEN, MOST_SEEN = 0.3, 0.1, 1.0
"""Length of the movements that is asked for, and the bounds within which it may be seen, m."""
MOST_TURNED = 35.0 * DEG
"""Largest angle between the body's nose by the poses and by the IMU, rad; as in the preflight."""
MOST_ASKEW = 45.0 * DEG
"""Largest angle between a dip and that of the nose, rad."""
LEAST_CORNER, MOST_CORNER = 20.0 * DEG, 160.0 * DEG
"""Bounds of the angle, to the left, from the carry along x to that along y by the IMU, rad."""

_AXES = {HandStep.LIFT: 2, HandStep.ALONG_X: 0, HandStep.ALONG_Y: 1}
_ASKED = {HandStep.LIFT: "up", HandStep.ALONG_X: "along +x", HandStep.ALONG_Y: "along +y"}
_LINES = {HandStep.LIFT: "up axis", HandStep.ALONG_X: "x axis", HandStep.ALONG_Y: "y axis"}
_RIGHT = (0, 1, 2), (1.0, 1.0, 1.0)
_NED = (1, 0, 2), (1.0, 1.0, -1.0)
_Z_READ_AS_Y_UP = (0, 2, 1), (1.0, -1.0, 1.0)
_Y_READ_AS_Z_UP = (0, 2, 1), (1.0, 1.0, -1.0)
_NOT_EXPRESSED = (
    "which the stream's `axes` can't express: set a right-handed frame with z up, and x as in the"
    " mission, in the motion-capture software"
)
_DEFINE = "define the body anew in the motion-capture software, with its x axis along the nose"
_AGAIN = "repeat the check, and move the vehicle along straight lines"


class DeclaredStream(NamedTuple):
    """What the mission declares of the poses' stream: its `units` and `axes`, None where its sensor
    has no such parameter."""

    units: str | None = None
    axes: str | None = None


class HandLine(NamedTuple):
    """A line of the verdict. check: what was judged."""

    check: str
    green: bool
    reason: str


def judge(
    motions: Sequence[HandMotion], stream: DeclaredStream, imu_trouble: str | None
) -> list[HandLine]:
    """Return the verdict on the finished steps; what can't be judged yet is red. imu_trouble: why
    the IMU is not used, None if it is."""
    carries = [motion for motion in motions if motion.step in _AXES]
    lines = [_scale(carries, stream, imu_trouble)]
    found = {motion.step: nearest_axis(motion.seen) for motion in carries}
    why = _explained(found, stream)
    for step in _AXES:
        lines.append(_axis(step, carries, found, why))
        why = why if lines[-1].green else ""  # told once
    dips = [motion for motion in motions if motion.step is HandStep.DIP]
    if not dips:
        lines.append(HandLine("nose", False, "not judged: the nose was not dipped"))
    elif not all(line.green for line in lines[1:]):
        lines.append(HandLine("nose", False, "not judged before the axes are right"))
    else:
        lines.append(_nose(dips[0], carries, imu_trouble))
    return lines


def named_way(way: Vec3) -> str:
    """Return a displacement in words: its length and the nearest axis."""
    axis, sign, _ = nearest_axis(way)
    direction = ("-" if sign < 0.0 else "+") + "xyz"[axis]
    words = {"+z": "up", "-z": "down"}.get(direction, f"along {direction}")
    return f"{named_length(norm(way))} {words}"


def named_length(metres: float) -> str:
    """Return a length with a suitable unit."""
    if metres < 0.01:
        return f"{1000.0 * metres:.2g} mm"
    return f"{100.0 * metres:.0f} cm" if metres < 2.0 else f"{metres:.0f} m"


def _scale(
    carries: Sequence[HandMotion], stream: DeclaredStream, imu_trouble: str | None
) -> HandLine:
    """Judge the scale of the poses."""
    if not carries:
        reason = "no movement was seen; if there was one, "
        return HandLine("scale", False, reason + _rescaled(0.0, stream))
    seen = sum(norm(motion.seen) for motion in carries) / len(carries)
    pairs = [(norm(m.seen), norm(m.felt)) for m in carries if m.felt is not None]
    if not pairs:
        green = LEAST_SEEN <= seen <= MOST_SEEN
        reason = f"movements of {named_length(seen)} were seen, about 30 cm were asked for"
        if green:
            why = imu_trouble or "the movements were too slow, or poses were missing"
            return HandLine("scale", True, f"{reason}; not judged more exactly: {why}")
        return HandLine("scale", False, f"{reason}: {_rescaled(seen / ASKED_WAY, stream)}")
    felt = sum(f for _, f in pairs) / len(pairs)
    factor = sum(s * f for s, f in pairs) / sum(f * f for _, f in pairs)
    green = MIN_SCALE <= factor <= MAX_SCALE
    reason = f"{named_length(seen)} by the poses, {named_length(felt)} by the IMU"
    if not green:
        times = f"{factor:.2g}" if factor < 10.0 else f"{factor:.0f}"
        reason = f"{times} times the IMU's motion ({reason}): {_rescaled(factor, stream)}"
    return HandLine("scale", green, reason)


def _rescaled(factor: float, stream: DeclaredStream) -> str:
    """Return what to change if the poses show `factor` times the motion."""
    if stream.units is None:
        return "check the stream's `units`"
    for units, low, high in (("m", 3e-4, 3e-3), ("mm", 300.0, 3000.0)):
        if low < factor < high and stream.units != units:
            return f"the stream is in {units}; write `units: {units}` in its sensor"
    return f"check `units: {stream.units}` of its sensor, and the cameras' calibration"


_Found = tuple[int, float, float]


def _explained(found: dict[HandStep, _Found], stream: DeclaredStream) -> str:
    """Return which axes explain the movements, and what to change. found: for each step the nearest
    axis, its sign and the angle to it."""
    seen = {_AXES[step]: found[step] for step in found}
    if len(seen) < 3 or len({axis for axis, *_ in seen.values()}) < 3:
        return f"check the stream's `axes`, or {_AGAIN}"
    order, sign = [0, 0, 0], [1.0, 1.0, 1.0]
    for true, (axis, direction, _) in seen.items():
        order[axis], sign[axis] = true, direction
    axes = (order[0], order[1], order[2]), (sign[0], sign[1], sign[2])
    if axes == _RIGHT:
        return ""
    if axes == _NED:
        return f"the stream is north-east-down, {_NOT_EXPRESSED}"
    for needed, other, shown in (
        ("z_up", "y_up", _Z_READ_AS_Y_UP), ("y_up", "z_up", _Y_READ_AS_Z_UP)
    ):  # fmt: skip
        if axes == shown:
            if stream.axes == other:
                return f"the stream has {needed[0]} up; write `axes: {needed}` in its sensor"
            return f"the stream has {needed[0]} up instead of {other[0]}: check its `axes`"
    return f"motion capture shows {axes_words(*axes)}, {_NOT_EXPRESSED}"


def _axis(
    step: HandStep, carries: Sequence[HandMotion], found: dict[HandStep, _Found], why: str
) -> HandLine:
    """Judge the axis along which a step was to move the vehicle. why: what explains the axes."""
    motion = next((motion for motion in carries if motion.step is step), None)
    name = _LINES[step]
    if motion is None:
        return HandLine(name, False, "not judged: the movement was not seen")
    axis, sign, off = found[step]
    reason = f"seen: {named_way(motion.seen)}"
    if (axis, sign) == (_AXES[step], 1.0):
        return HandLine(name, True, f"{reason} ({degrees(off):.0f} deg aside)")
    reason += f" instead of {_ASKED[step]}"
    why = _misled(step, motion, carries) or why
    return HandLine(name, False, f"{reason}: {why}" if why else reason)


def _misled(step: HandStep, motion: HandMotion, carries: Sequence[HandMotion]) -> str:
    """Return how the hand moved otherwise than asked, by the IMU; empty if it did as asked."""
    if motion.felt is None:
        return ""
    if step is HandStep.LIFT and motion.felt[2] < 0.5 * norm(motion.felt):
        return f"by the IMU, it was not lifted but moved by {named_way(motion.felt)}; {_AGAIN}"
    before = next((m for m in carries if m.step is HandStep.ALONG_X and m.felt is not None), None)
    if step is HandStep.ALONG_Y and before is not None and before.felt is not None:
        corner = wrap(_direction(motion.felt) - _direction(before.felt))
        if not LEAST_CORNER < corner < MOST_CORNER:
            turn = f"{degrees(corner):.0f} deg to the left of the first carry, not about 90"
            return f"by the IMU, it was carried {turn}; {_AGAIN}"
    return ""


def _nose(dip: HandMotion, carries: Sequence[HandMotion], imu_trouble: str | None) -> HandLine:
    """Judge the body's heading."""
    seen = _askew(dip.seen_turn)
    if dip.felt_turn is None:
        reason = f"the body's x axis is {_turn(-seen)} of what was dipped"
        green = abs(seen) <= MOST_ASKEW
        if not green:
            reason += f": if that was the nose, {_DEFINE}"
        why = imu_trouble or "the IMU is not used"
        return HandLine("nose", green, f"{reason}; not judged more exactly: {why}")
    felt = _askew(dip.felt_turn)
    turned = wrap(felt - seen)
    reason = f"the body's x axis is {_turn(turned)} of the nose by the dip"
    carried = _by_carries(carries)
    if carried is not None:
        reason += f", {_turn(carried)} by the carries"
        if abs(wrap(carried - turned)) > MOST_ASKEW:
            return HandLine("nose", False, f"{reason}, which contradict each other; {_AGAIN}")
    if abs(turned) <= MOST_TURNED:
        return HandLine("nose", True, f"{reason} ({degrees(MOST_TURNED):.0f} deg allowed)")
    if abs(felt) <= MOST_ASKEW:
        reason += f": {_DEFINE}"
    elif abs(seen) <= MOST_ASKEW:
        reason += (
            f"; by the IMU, the dip was {_turn(felt)} of its nose: the IMU is mounted turned, set"
            " its orientation in the autopilot"
        )
    else:
        reason += (
            f"; by the IMU, the dip was {_turn(felt)} of the nose: repeat the check, and dip the"
            " nose"
        )
    return HandLine("nose", False, reason)


def _askew(turn: Vec3) -> float:
    """Return the angle of a dip from one of the nose, counter-clockwise from above, rad."""
    return wrap(atan2(turn[1], turn[0]) - 0.5 * pi)


def _by_carries(carries: Sequence[HandMotion]) -> float | None:
    """Return by how much the body is turned to the left, rad, by the horizontal movements relative
    to the heading, by the poses and by the IMU."""
    x = y = 0.0
    for motion in carries:
        if motion.felt is not None and motion.step is not HandStep.LIFT:
            seen = _direction(motion.seen) - motion.seen_heading
            felt = _direction(motion.felt) - motion.felt_heading
            x, y = x + cos(felt - seen), y + sin(felt - seen)
    return atan2(y, x) if x or y else None


def _direction(way: Vec3) -> float:
    """Return the horizontal direction of a displacement, counter-clockwise from x, rad."""
    return atan2(way[1], way[0])


def _turn(angle: float) -> str:
    """Return an angle to the left or to the right in words."""
    return f"{abs(degrees(angle)):.0f} deg to the {'left' if angle >= 0.0 else 'right'}"
