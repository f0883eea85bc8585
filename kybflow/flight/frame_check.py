"""Compares the motion that motion capture measures with the motion that the IMU measures.

If the units, the axes or the body's heading of a stream differ from the mission, its poses are
consistent with each other but wrong, which no filter of poses can detect. The IMU can. From rest,
where its errors and its angle to the body are learned, its rates w and specific forces f are
integrated to an attitude R, a velocity v and a position x in the frame of the poses:

    R' = R [w],    v' = R f - g e3,    x' = v

R follows the attitude of the poses with the time constant `CORRECTION_TIME_S`, because the integral
of w drifts. Once the frame is confirmed (`CONFIRMING_COMPARISONS`), it does so with
`CONFIRMED_TIME_S`, and the bias of w follows too: otherwise a gyroscope whose bias has changed by
0.03 rad/s would tilt R by 7 degrees and accuse the poses. v and x drift too, but a constant and a
linear error of x vanish in the second difference over three moments h apart, which for the
positions p of the poses and for x is the mean acceleration, weighted by a triangle (as if two
accelerometers were compared):

    a(y) = (y(t) - 2 y(t - h) + y(t - 2 h)) / h^2,    difference = a(p) - a(x)

The frame is wrong if along the vertical, or across it, the difference exceeds both of

    MIN_DIFFERENCE + 4 deviations of the noise,  and  share max(|a(p)|, |a(x)|)

in `NEEDED_COMPARISONS` comparisons in a row. The noise is that of the poses, measured by their
second differences over three comparisons in a row, and that of the IMU. The second bound is never
exceeded by a body that is turned by 30 degrees or a scale that is 10 % off, but by an exchanged,
mirrored or missing axis, by a turn of 90 degrees or more, and by millimetres or feet taken for
metres. A turn about the vertical changes nothing along it, so that its share there is smaller.

World frame and body frame as in `kybflow.core.geometry`; metres, seconds, radians. No value of the
simulator is used: only poses and IMU samples.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import permutations, product
from math import acos, fsum, hypot, radians, sqrt
from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    UP,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    cross,
    distance,
    dot,
    integrate,
    multiply,
    norm,
    rotate,
    rotate_back,
    scale,
    sub,
)
from kybflow.core.signals import (
    NS,
    Imu,
    InertialMotion,
    Measurement,
    Pose,
    Time,
    WrongFrame,
)

COMPARISON_PERIOD_NS: Time = NS // 21
"""Least time between two comparisons, ns: 50 ms with 100 or 120 poses a second."""
SPAN_COMPARISONS = 3
"""Comparisons in h, so that h is 0.15 s."""
MAX_SPAN_S = 1.0
"""Longest time of the three moments, s; after a longer one, poses were lost, and the integral of an
IMU whose samples miss much is of no use. After 4 s of it a PX4 that stood on the ground seemed
tilted by 27 degrees."""
MIN_DIFFERENCE = 0.6
"""The difference of accelerations below which nothing is wrong, m/s^2."""
_AGREEING_SQUARE = (0.5 * MIN_DIFFERENCE) ** 2
SHARE_UP, SHARE_ACROSS = 0.4, 0.65
"""The share of the larger acceleration below which nothing is wrong, along and across the
vertical."""
NEEDED_COMPARISONS = 3
CONFIRMING_COMPARISONS = 120
"""Comparisons, 6 s with the rotors turning, that confirm a frame: a position loop that is closed
over a wrong one diverges sooner."""
NOISE_SIGMAS = 4.0
CORRECTION_TIME_S, CONFIRMED_TIME_S, CORRECTION_COMPARISONS = 4.0, 1.0, 5
"""Time constants with which the attitude follows the poses, s, before and after the frame is
confirmed, and how many comparisons pass between two corrections."""
MAX_CORRECTION = radians(2.0)
"""The largest difference of the attitudes, rad, by which the attitude is corrected until the frame
is confirmed. That of a wrong frame is larger, and that of an integral of w is smaller at first."""
MAX_DRIFT = radians(10.0)
"""The largest difference of the attitudes, rad, that a drift of the integral explains once the
frame is confirmed. In flight, a frame that becomes another one differs by more."""
NOISE_SHARE = 0.05
"""Share of a new sample in the running noise."""
MIN_JUMP = 0.015
"""A second difference of three comparisons in a row above which the poses jumped, m, if the next
one is opposite, as it never is in a wrong frame."""
REST_AVERAGING_S = 0.5
"""Seconds over which the IMU at rest is averaged."""
KNOWN_TIME_S, MOVING_FORCE = 0.1, 0.5
"""Seconds at rest after which the specific force there is known, and a change of it that shows that
the vehicle moves, m/s^2."""
SETTLING_TIME_NS, MOVED_TIME_NS = NS, 3 * NS
"""Time after which it rests again, and after which it stands otherwise than before, ns."""
MAX_FINE_SAMPLE_S = 0.0125
"""Longest interval (s) of IMU samples that don't miss a blow such as the touch-down. Otherwise the
blow is in all comparisons of 2 h, so that as many more in a row must show a wrong frame. So must
they in an autopilot's land mode: a PX4's samples missed a touch-down of 0.5 m/s at any rate."""
MAX_SAMPLE_S, MAX_GAP_NS = 0.045, NS // 8
"""Longest interval of IMU samples of which the integral is exact enough, s: autopilots send 25 a
second. Longest gap between samples, ns."""
MAX_LEAD_NS: Time = round(MAX_SAMPLE_S * NS)
"""By how much a pose may be newer than the IMU, ns; a newer one waits for it."""
MAX_PIECE_S = 0.1
"""Longest time over which the samples are averaged before they are integrated, s."""
MAX_UNEVEN = 1.2
"""The longest sample over the mean one from which each is weighted by its length."""
MOST_SAMPLES, MOST_POSES = 512, 32
"""How many samples are kept for late poses, and how many poses for late samples."""
SILENCE_NS: Time = NS // 4
"""Time without an IMU sample after which the link to the vehicle is lost, which is another
supervisor's business, ns."""
MAX_UNCOMPARED_S = 1.0
"""How long poses may come in flight without one that can be compared, s."""
MAX_SPIN = 3.0
"""Turn rate about body z, rad/s, above which the integral is not exact enough to judge by, such as
that of a vehicle with a weak rotor."""
BLOW_FORCE = 3.0 * GRAVITY
"""Specific force, m/s^2, of a blow that samples don't resolve."""
MAX_BIAS = 1.5
"""Largest plausible difference of the specific force at rest from gravity, m/s^2."""


class _Moment(NamedTuple):
    """time: s. apart: the position of the poses less that of the IMU. moved: that of the IMU."""

    time: float
    apart: Vec3
    moved: Vec3


_Piece = tuple[Vec3, Vec3, float]
"""What the IMU measured in a short time: the angle, rad, and the change of velocity, m/s, in body
axes, and that time, s."""


class FrameCheck:
    """The check of one vehicle.

    due: the time of the next pose to process.
    wrong: the finding, None without one. From then on the IMU is integrated without the poses.
    uncompared: for how long poses have come in flight of which none could be compared, s; zero once
    the frame is confirmed, and for a vehicle whose IMU was not good enough on the ground.
    slant: the angle between the vertical by the poses and by the accelerometer at rest, rad; None
    while unknown. shake: how far the poses at rest are from steady, m.
    """

    __slots__ = (
        "_acceleration",
        "_across",
        "_agrees",
        "_attitude",
        "_awaits_blow",
        "_bias",
        "_coarse",
        "_expects",
        "_felt",
        "_jolted",
        "_leap",
        "_levelled",
        "_moments",
        "_moved",
        "_newest",
        "_noise",
        "_offset",
        "_pairs",
        "_poses",
        "_rested",
        "_rests",
        "_seen",
        "_seldom",
        "_shaking",
        "_since",
        "_slope",
        "_steps",
        "_still",
        "_stirred",
        "_turned",
        "_upward",
        "_velocity",
        "_waiting",
        "due",
        "shake",
        "slant",
        "uncompared",
        "wrong",
    )  # fmt: skip

    def __init__(self) -> None:
        self.due: Time = 0
        self.wrong: WrongFrame | None = None
        self.slant: float | None = None
        self.shake = self.uncompared = 0.0
        self._waiting: deque[Imu] = deque(maxlen=MOST_SAMPLES)
        self._poses: deque[Pose] = deque(maxlen=MOST_POSES)
        self._newest = self._since = self._still = 0
        self._stirred: Time = -SETTLING_TIME_NS
        self._rests, self._jolted, self._agrees, self._expects = True, False, False, False
        self._coarse = self._seldom = True
        self._awaits_blow = False
        self._rested, self._felt, self._turned, self._levelled = 0.0, ZERO, ZERO, LEVEL
        self._bias = self._noise = self._shaking = 0.0
        self._seen: tuple[Vec3, ...] = ()
        self._attitude: Quat = LEVEL
        self._velocity = self._moved = self._offset = self._slope = self._leap = ZERO
        self._acceleration: Vec3 = ZERO
        self._moments: deque[_Moment] = deque(maxlen=2 * SPAN_COMPARISONS + 1)
        self._pairs: deque[tuple[Vec3, Vec3]] = deque(maxlen=2 * SPAN_COMPARISONS)
        self._upward = self._across = self._steps = 0

    @property
    def is_judged(self) -> bool:
        """Whether the frame can be judged in flight: the IMU was heard at rest, often enough."""
        return self._rested > 0.0 and not self._seldom

    @property
    def is_confirmed(self) -> bool:
        """Whether the frame was compared for so long that it was right at the take-off."""
        return self._steps >= CONFIRMING_COMPARISONS

    def is_current(self, now: Time) -> bool:
        """Return whether the motion by the IMU is known up to about `now`."""
        return now - self._since <= MAX_GAP_NS

    def motion(self, now: Time) -> InertialMotion:
        """Return the motion by the IMU at `now`, from rest or from the last time when the poses
        agreed with it. Since the last sample, for `MAX_GAP_NS` at most, the vehicle is taken to
        accelerate steadily."""
        velocity = add(self._velocity, self._offset)
        ahead = add(velocity, scale(self._acceleration, min(now - self._since, MAX_GAP_NS) / NS))
        fx, fy, _ = rotate(self._attitude, (1.0, 0.0, 0.0))
        n = hypot(fx, fy) or 1.0
        fx, fy = fx / n, fy / n
        forward, acceleration = (
            (fx * x + fy * y, fx * y - fy * x, z) for x, y, z in (ahead, self._acceleration)
        )
        return InertialMotion(forward, acceleration)

    def add_imu(self, imu: Imu) -> None:
        """Add an IMU sample."""
        self._waiting.append(imu)
        self._newest = imu.time

    def add_poses(
        self, measurements: Sequence[Measurement], rotors_turn: bool, awaits_blow: bool = False
    ) -> None:
        """Process the poses among the measurements that are due, each with the IMU samples before
        it, whichever of the two is late. rotors_turn: whether the rotors turn, so that the vehicle
        may fly. awaits_blow: whether it may touch down in its own land mode."""
        self._awaits_blow = awaits_blow
        for measurement in measurements:
            if isinstance(measurement, Pose) and measurement.time >= self.due:
                time = measurement.time
                if self._expects and rotors_turn and not self.is_confirmed:
                    since = time - self.due + COMPARISON_PERIOD_NS
                    self.uncompared += since / NS if since <= MAX_GAP_NS else 0.0
                    if time - self._newest > SILENCE_NS:
                        self.uncompared = 0.0
                self.due = time + COMPARISON_PERIOD_NS
                self._poses.append(measurement)
        while self._poses and (
            not rotors_turn or self._poses[0].time <= self._newest + MAX_LEAD_NS
        ):
            self._add(self._poses.popleft(), rotors_turn)
        if self.wrong is not None and rotors_turn and self._waiting:
            self._integrate(self._pieces(self._newest))

    def _add(self, pose: Pose, rotors_turn: bool) -> None:
        """Process one pose."""
        time, begun = pose.time, self._since
        aligned = rotors_turn or not self._rests
        pieces = self._pieces(time if aligned else self._newest)
        if not pieces and (rotors_turn or time - begun < MAX_GAP_NS):
            return
        angle, gained, seconds = pieces[-1] if pieces else (ZERO, ZERO, 0.0)
        if not rotors_turn and self._is_still(time, gained, seconds):
            self._rest(pose, angle, gained, seconds)
            self.due = time + 1
            return
        if self._rests:
            self._rests = False
            self._begin()
        elapsed, known = self._since - begun, fsum(piece[2] for piece in pieces) * NS
        if self.wrong is not None:
            self._integrate(pieces)
        elif (
            not 0.5 * elapsed < known < 2.0 * elapsed
            or elapsed > MAX_SPAN_S * NS
            or self._jolted
            or not self.is_judged
        ):
            self._restart(pose)
        elif abs(angle[2]) > MAX_SPIN * seconds:
            self._restart(pose)
            self.uncompared = 0.0
        else:
            self._integrate(pieces)
            self._compare(time, pose.position, (self._since - time) / NS)
            self._steps += 1
            if self._steps % CORRECTION_COMPARISONS == 0:
                self._follow(pose, CORRECTION_COMPARISONS * known / NS)

    def _pieces(self, time: Time) -> Sequence[_Piece]:
        """Return the motion by the waiting samples up to `time`, in pieces of `MAX_PIECE_S` at
        most; forget these samples."""
        waiting = self._waiting
        if self._newest <= time:
            samples = list(waiting)
            waiting.clear()
        else:
            samples = []
            while waiting and waiting[0].time <= time:
                samples.append(waiting.popleft())
        if not samples:
            return ()
        self._since = samples[-1].time
        self._jolted = self._seldom = False
        size = max(1, int(MAX_PIECE_S / max(samples[0].dt, 1e-3)))
        return [self._piece(samples[i : i + size]) for i in range(0, len(samples), size)]

    def _piece(self, samples: Sequence[Imu]) -> _Piece:
        _, periods, forces, rates = zip(*samples, strict=True)
        seconds = fsum(periods)
        share = seconds / len(samples)
        longest = max(periods)
        if longest > MAX_UNEVEN * share:  # ticks were late; each sample counts by its length
            forces = tuple(scale(f, dt / share) for f, dt in zip(forces, periods, strict=True))
            rates = tuple(scale(w, dt / share) for w, dt in zip(rates, periods, strict=True))
        fx, fy, fz = map(fsum, zip(*forces, strict=True))
        wx, wy, wz = map(fsum, zip(*rates, strict=True))
        change = samples[-1].specific_force[2] - samples[0].specific_force[2]
        self._jolted |= change * change > BLOW_FORCE * BLOW_FORCE
        self._shaking += NOISE_SHARE * (0.5 * share * change * change - self._shaking)
        self._coarse = share > MAX_FINE_SAMPLE_S
        self._seldom |= share > MAX_SAMPLE_S or longest > MAX_PIECE_S
        angle, gained = (share * wx, share * wy, share * wz), (share * fx, share * fy, share * fz)
        return angle, gained, seconds

    def _is_still(self, time: Time, gained: Vec3, seconds: float) -> bool:
        """Return whether a vehicle whose rotors should rest has been still for long enough: an
        autopilot may lift it already, and a hand may carry it."""
        if seconds > 0.0 and self._rested >= KNOWN_TIME_S:
            if distance(scale(gained, 1.0 / seconds), self._felt) <= MOVING_FORCE:
                self._still = time
            else:
                self._stirred = time
                if time - self._still > MOVED_TIME_NS:
                    self._rested = 0.0  # it stands on a slope now
                    self._stirred = time - SETTLING_TIME_NS
        return time - self._stirred >= SETTLING_TIME_NS

    def _rest(self, pose: Pose, angle: Vec3, gained: Vec3, seconds: float) -> None:
        """Learn the IMU's errors at rest, and its angle to the body."""
        if seconds > 0.0:
            self._rested = min(self._rested + seconds, REST_AVERAGING_S)
            share = seconds / self._rested
            self._felt = _mixed(self._felt, scale(gained, 1.0 / seconds), share)
            self._turned = _mixed(self._turned, scale(angle, 1.0 / seconds), share)
            weight = norm(self._felt)
            if abs(weight - GRAVITY) <= MAX_BIAS:
                self._bias = weight - GRAVITY
                up, felt = rotate_back(pose.attitude, UP), scale(self._felt, 1.0 / weight)
                cosine = max(-1.0, min(1.0, dot(up, felt)))
                self.slant = acos(cosine)
                x, y, z = cross(felt, up)
                n = sqrt(x * x + y * y + z * z + (1.0 + cosine) ** 2)
                self._levelled = LEVEL if n < 1e-6 else ((1.0 + cosine) / n, x / n, y / n, z / n)
        self._velocity = self._moved = self._offset = self._acceleration = ZERO
        self.wrong, self._rests, self._expects = None, True, self.is_judged
        self.uncompared = 0.0
        seen = self._seen
        self._seen = (*seen[-1:], pose.position)
        if len(seen) > 1:
            leap = add(sub(pose.position, seen[-1]), sub(seen[-2], seen[-1]))
            self._noise += NOISE_SHARE * (dot(leap, leap) - self._noise)
            self.shake = sqrt(self._noise)
        self._attitude = multiply(pose.attitude, self._levelled)

    def _begin(self) -> None:
        """Compare from the next pose on: poses jumped, or the integral was interrupted."""
        self._moments.clear()
        self._agrees, self._upward, self._across = False, 0, 0

    def _restart(self, pose: Pose) -> None:
        """Begin again: samples or poses are missing, a blow was not resolved, or it spins."""
        self._begin()
        self._attitude = multiply(pose.attitude, self._levelled)

    def _integrate(self, pieces: Iterable[_Piece]) -> None:
        """Integrate the IMU."""
        for angle, gained, seconds in pieces:
            if seconds > 0.0:
                self._move(angle, gained, seconds)

    def _move(self, angle: Vec3, gained: Vec3, seconds: float) -> None:
        gx, gy, gz = gained
        ax, ay, az = angle
        bx, by, bz = self._turned
        turned = ax, ay, az = ax - seconds * bx, ay - seconds * by, az - seconds * bz
        dx, dy, dz = rotate(  # at the attitude in the middle: f + w x f / 2
            self._attitude,
            (
                gx + 0.5 * (ay * gz - az * gy),
                gy + 0.5 * (az * gx - ax * gz),
                gz + 0.5 * (ax * gy - ay * gx),
            ),
        )
        dz -= (GRAVITY + self._bias) * seconds
        vx, vy, vz = self._velocity
        px, py, pz = self._moved
        self._moved = (
            px + seconds * (vx + 0.5 * dx),
            py + seconds * (vy + 0.5 * dy),
            pz + seconds * (vz + 0.5 * dz),
        )
        self._velocity = (vx + dx, vy + dy, vz + dz)
        self._acceleration = (dx / seconds, dy / seconds, dz / seconds)
        self._attitude = integrate(self._attitude, turned, 1.0)

    def _follow(self, pose: Pose, seconds: float) -> None:
        """Move the attitude, the bias and the velocity towards those of the poses, as far as these
        agree with the IMU. seconds: since this was last done."""
        attitude = self._attitude
        w, x, y, z = multiply(conjugate(attitude), multiply(pose.attitude, self._levelled))
        turn, angle = 2.0 if w > 0.0 else -2.0, 2.0 * sqrt(x * x + y * y + z * z)
        if self.is_confirmed:
            if angle > MAX_DRIFT:
                return
            learned = -0.25 * turn * seconds / CONFIRMED_TIME_S**2  # critically damped
            self._turned = add(self._turned, scale((x, y, z), learned))
            turn *= seconds / CONFIRMED_TIME_S
        else:
            turn *= seconds / CORRECTION_TIME_S * min(1.0, MAX_CORRECTION / max(angle, 1e-9))
        self._attitude = integrate(attitude, (x, y, z), turn)
        if self._agrees:
            share = seconds / CORRECTION_TIME_S
            self._offset = _mixed(self._offset, self._slope, share)

    def _compare(self, time: Time, seen: Vec3, late: float) -> None:
        """Compare the accelerations. late: by how much the IMU is newer than the pose, s."""
        px, py, pz = seen
        mx, my, mz = self._moved
        vx, vy, vz = self._velocity
        x, y, z = mx - late * vx, my - late * vy, mz - late * vz
        moments, now = self._moments, time / NS
        apart = ax, ay, az = px - x, py - y, pz - z
        if moments:
            before = moments[-1]
            bx, by, bz = before.apart
            soon = now - before.time
            slope = sx, sy, sz = (ax - bx) / soon, (ay - by) / soon, (az - bz) / soon
            tx, ty, tz = self._slope
            self._slope = slope
            if len(moments) > 1 and self._leaps(
                (soon * (sx - tx), soon * (sy - ty), soon * (sz - tz))
            ):
                self._begin()
                self.uncompared = 0.0
        moments.append(_Moment(now, apart, (x, y, z)))
        if len(moments) <= 2 * SPAN_COMPARISONS:
            return
        first, middle = moments[0], moments[SPAN_COMPARISONS]
        early, soon = middle.time - first.time, now - middle.time
        if early + soon > MAX_SPAN_S:
            return
        self.uncompared = 0.0
        ex, ey, ez = off = _bend(first.apart, middle.apart, apart, early, soon)
        across = ex * ex + ey * ey
        self._agrees = across < _AGREEING_SQUARE and ez * ez < _AGREEING_SQUARE
        if self._agrees:
            self._upward = self._across = 0
        else:
            felt = _bend(first.moved, middle.moved, (x, y, z), early, soon)
            area = early * soon
            spread = self._noise / (3.0 * area * area) + self._shaking / (1.5 * soon)
            self._judge(off, felt, MIN_DIFFERENCE + NOISE_SIGMAS * sqrt(spread))

    def _leaps(self, leap: Vec3) -> bool:
        """Update the noise of the poses by their second difference (m); return whether they jumped
        in the last step but one."""
        before, self._leap = self._leap, leap
        square = dot(leap, leap)
        if square > MIN_JUMP * MIN_JUMP and dot(leap, before) < -0.25 * MIN_JUMP * MIN_JUMP:
            return True
        self._noise += NOISE_SHARE * (min(square, MIN_JUMP * MIN_JUMP) - self._noise)
        return False

    def _judge(self, off: Vec3, felt: Vec3, least: float) -> None:
        """Compare the IMU's velocity change with its difference from that of the poses, m/s^2.
        least: the largest difference by noise."""
        ex, ey, ez = off
        gx, gy, gz = felt
        seen = sx, sy, sz = gx + ex, gy + ey, gz + ez
        up, across = abs(ez), hypot(ex, ey)
        up_bound = max(least, SHARE_UP * max(abs(gz), abs(sz)))
        across_bound = max(least, SHARE_ACROSS * max(hypot(gx, gy), hypot(sx, sy)))
        self._upward = self._upward + 1 if up > up_bound else 0
        self._across = self._across + 1 if across > across_bound else 0
        self._pairs.append((seen, felt))
        misses = self._coarse or self._awaits_blow
        needed = NEEDED_COMPARISONS + (2 * SPAN_COMPARISONS if misses else 0)
        if self.wrong is None and max(self._upward, self._across) >= needed:
            value, bound = (up, up_bound) if self._upward else (across, across_bound)
            self.wrong = WrongFrame(explained(self._pairs), value, bound)


def _mixed(old: Vec3, new: Vec3, share: float) -> Vec3:
    """Return the mean of two vectors, in which the new one has a share."""
    return add(scale(old, 1.0 - share), scale(new, share))


def _bend(a: Vec3, b: Vec3, c: Vec3, early: float, soon: float) -> Vec3:
    """Return the acceleration (m/s^2) of a motion from `a` to `b` in `early` seconds and on to `c`
    in `soon` seconds."""
    k = 2.0 / (early + soon)
    h, k = k / early, k / soon
    ax, ay, az = a
    bx, by, bz = b
    cx, cy, cz = c
    return (
        k * (cx - bx) - h * (bx - ax),
        k * (cy - by) - h * (by - ay),
        k * (cz - bz) - h * (bz - az),
    )


_NAMES = "xyz"
_SIMILAR_FIT, _GOOD_SHARE, _BEST_SHARE = 1.4, 0.05, 0.4
"""How much worse than the best explanation another one may fit, and the shares of the
accelerations' squares that a good explanation may leave, and the best one."""


class _Axes(NamedTuple):
    """Axes in which poses may be: the position along axis i is sign[i] times that along order[i] of
    the declared axes. words: how this shows."""

    words: str
    order: tuple[int, int, int]
    sign: Vec3

    def left(self, seen: Vec3, felt: Vec3) -> float:
        """Return the square of what these axes leave unexplained."""
        i, j, k = self.order
        sx, sy, sz = self.sign
        x, y, z = seen
        return (x - sx * felt[i]) ** 2 + (y - sy * felt[j]) ** 2 + (z - sz * felt[k]) ** 2


def explained(pairs: Iterable[tuple[Vec3, Vec3]]) -> str:
    """Return what explains that motion capture saw other accelerations than the IMU felt, and what
    to check: another scale, or the axes of which up to three fit best. pairs: (seen, felt), m/s^2,
    in the frame of the poses."""
    both = list(pairs)
    felt_square = fsum(dot(felt, felt) for _, felt in both)
    total = felt_square + fsum(dot(seen, seen) for seen, _ in both)
    factor = max(fsum(dot(seen, felt) for seen, felt in both) / max(felt_square, 1e-9), 0.0)
    scaled = fsum(_square(sub(seen, scale(felt, factor))) for seen, felt in both)
    rest = [fsum(axes.left(seen, felt) for seen, felt in both) for axes in _ALL_AXES]
    least = min(rest)
    if min(least, scaled) > _BEST_SHARE * total:
        return (
            "motion capture and IMU disagree about the motion: check the stream's `units` and"
            " `axes`, and the body's heading"
        )
    enough = max(_SIMILAR_FIT * least, _GOOD_SHARE * total)
    if scaled <= enough:
        return f"motion capture shows {factor:.2g} times the motion: check the stream's `units`"
    fitting = zip(_ALL_AXES, rest, strict=True)
    words = dict.fromkeys(axes.words for axes, left in fitting if left <= enough)
    return (
        f"motion capture shows {' or '.join(list(words)[:3])}: check the stream's `axes`, and that"
        " the body's x axis points along the nose"
    )


def _square(a: Vec3) -> float:
    return dot(a, a)


def _all_axes() -> tuple[_Axes, ...]:
    """Return all axes but the declared ones, the likeliest first."""
    turned, exchanged, tipped = [], [], []
    for i, j, k in permutations(range(3)):
        for x, y, z in product((1.0, -1.0), repeat=3):
            order, sign = (i, j, k), (x, y, z)
            if k != 2 or z < 0.0:
                where = order.index(2)
                name = ("" if sign[where] > 0.0 else "-") + _NAMES[where]
                tipped.append(_Axes(f"upward motion along {name}", order, sign))
            elif x * y > 0.0 and i == 1:
                exchanged.append(_Axes("x and y exchanged", order, sign))
            elif x * y < 0.0 and i == 0:
                flipped = "x" if x < 0.0 else "y"
                exchanged.append(_Axes(f"{flipped} mirrored", order, sign))
            elif x < 0.0 or i == 1:
                turn = 180 if i == 0 else 90 if y > 0.0 else -90
                turned.append(_Axes(f"the motion turned by {turn} deg", order, sign))
    return (*turned, *exchanged, *tipped)


_ALL_AXES = _all_axes()


def axes_words(order: tuple[int, int, int], sign: Vec3) -> str:
    """Return in words how poses in other axes show: the position along axis i is sign[i] times that
    along order[i] of the declared axes."""
    return next(axes.words for axes in _ALL_AXES if (axes.order, axes.sign) == (order, sign))
