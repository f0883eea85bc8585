"""frame_check: a wrong frame is told from the motion that shows it, and a right one never."""

from __future__ import annotations

import random
from math import cos, pi, radians, sin

import pytest

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    from_euler,
    from_heading,
    from_thrust_direction,
    multiply,
    norm,
    rotate_back,
    scale,
)
from kybflow.core.signals import NS, Imu, Pose, WrongFrame
from kybflow.flight.frame_check import MAX_UNCOMPARED_S, FrameCheck, explained

RATE, REST = 125, 0.4
"""IMU samples and poses a second; seconds at rest before the motion."""


class Motion:
    """A swing along each axis from rest at time 0, with a(t) = s w^2 sin(w t). swings: s in
    metres and w in rad/s, of each axis."""

    def __init__(self, swings: tuple[tuple[float, float], ...], heading: float = 0.0) -> None:
        self._swings, self._heading = swings, heading

    def position(self, t: float) -> Vec3:
        x, y, z = (s * (w * t - sin(w * t)) if t > 0.0 else 0.0 for s, w in self._swings)
        return (x, y, z)

    def velocity(self, t: float) -> Vec3:
        x, y, z = (s * w * (1.0 - cos(w * t)) if t > 0.0 else 0.0 for s, w in self._swings)
        return (x, y, z)

    def acceleration(self, t: float) -> Vec3:
        x, y, z = (s * w * w * sin(w * t) if t > 0.0 else 0.0 for s, w in self._swings)
        return (x, y, z)

    def attitude(self, t: float) -> Quat:
        force = add(self.acceleration(t), (0.0, 0.0, GRAVITY))
        return from_thrust_direction(force, self._heading + 0.3 * sin(max(t, 0.0)))


def told(
    motion: Motion,
    change=lambda position, attitude: (position, attitude),
    seconds: float = 3.0,
    mount: Quat = LEVEL,
    bias: Vec3 = ZERO,
    noise: float = 0.0005,
    latency: int = 1,
    lost=lambda k: False,
    late=lambda k: (0, 0),
    drift: float = 0.0,
    bounds: list[float] | None = None,
) -> tuple[WrongFrame | None, float]:
    """(the finding, when). change: what the stream does to a pose. mount: the attitude of the IMU
    in the body. lost: which IMU samples are. late: by how many ticks the IMU sample and the pose of
    a tick arrive late, if no later one may overtake them; a pose never arrives if it is None.
    drift: by which share the clock of the poses runs faster. bounds: is given `uncompared`."""
    check, rng, dt = FrameCheck(), random.Random(1), 1.0 / RATE
    samples: list[tuple[int, Imu]] = []
    poses: list[tuple[int, Pose]] = []
    substeps = 2
    for k in range(round((seconds + REST) * RATE)):
        t = k * dt - REST
        forces = turns = ZERO
        for i in range(substeps):
            at = t - dt * (i + 0.5) / substeps
            q, later = motion.attitude(at), motion.attitude(at + 1e-4)
            _, x, y, z = multiply(conjugate(q), later)
            turns = add(turns, scale((x, y, z), 2.0 / 1e-4 / substeps))
            force = rotate_back(q, add(motion.acceleration(at), (0.0, 0.0, GRAVITY)))
            forces = add(forces, scale(force, 1.0 / substeps))
        shaken = add(forces, (rng.gauss(0.0, 0.3), rng.gauss(0.0, 0.3), rng.gauss(0.0, 0.5)))
        felt = add(rotate_back(mount, shaken), bias)
        time = round((t + REST + 1.0) * NS)
        measured = [] if lost(k) else [Imu(time, dt, felt, rotate_back(mount, turns))]
        then = t - latency * dt
        place = add(motion.position(then), tuple(rng.gauss(0.0, noise) for _ in range(3)))
        stamp = round((1.0 + drift) * (time - round(latency * dt * NS)))
        pose = Pose(stamp, *change(place, motion.attitude(then)))
        slow, slower = late(k)
        samples += [(k + slow, imu) for imu in measured]
        poses += [] if slower is None else [(k + slower, pose)]
        while samples and samples[0][0] <= k:
            check.add_imu(samples.pop(0)[1])
        arrived = next((i for i, (tick, _) in enumerate(poses) if tick > k), len(poses))
        check.add_poses([pose for _, pose in poses[:arrived]], t > 0.0)
        del poses[:arrived]
        if bounds is not None:
            bounds.append(check.uncompared)
        if check.wrong is not None:
            return check.wrong, t
    return None, seconds


def frame(order=(0, 1, 2), sign=(1.0, 1.0, 1.0), factor=1.0, turned=0.0, stiff=False):
    """What a stream in other axes makes of a pose."""
    i, j, _ = order
    hand = sign[0] * sign[1] * sign[2] * (1.0 if (j - i) % 3 == 1 else -1.0)

    def change(place, attitude):
        w, *turn = attitude
        axis = attitude if stiff else (w, *(hand * s * turn[n] for s, n in zip(sign, order)))  # noqa: B905
        x, y, z = (factor * s * place[n] for s, n in zip(sign, order))  # noqa: B905
        return (x, y, z), multiply(axis, from_heading(turned))

    return change


@pytest.mark.parametrize("seed", range(25))
def test_what_labs_get_slightly_wrong_is_no_alarm(seed):
    """A body defined turned by 30 and rolled by 10 degrees, a scale of 0.9, biases, late poses."""
    draw = random.Random(seed)
    swings = tuple((draw.uniform(0.1, 0.6), draw.uniform(1.0, 3.0)) for _ in range(3))
    heading, turned, roll = (draw.uniform(-most, most) for most in (pi, 30.0, 10.0))
    factor, latency = draw.uniform(0.9, 1.1), draw.randrange(7)
    bias = tuple(draw.uniform(-0.15, 0.15) for _ in range(3))

    def change(place, attitude):
        tilted = from_euler(radians(roll), 0.0, radians(turned))
        return scale(place, factor), multiply(attitude, tilted)

    found, when = told(Motion(swings, heading), change, bias=bias, latency=latency)
    assert found is None, (when, found)


WRONG = {
    "metres read as mm": (frame(factor=1e-3), "times the motion: check the stream's `units`"),
    "cm read as metres": (frame(factor=100.0), "times the motion: check the stream's `units`"),
    "feet read as metres": (frame(factor=3.28), "times the motion: check the stream's `units`"),
    "metres read as feet": (frame(factor=0.3048), "times the motion: check the stream's `units`"),
    "half the scale": (frame(factor=0.5), "times the motion: check the stream's `units`"),
    "z-up read as y-up": (frame((0, 2, 1), (1.0, -1.0, 1.0)), "upward motion along -y"),
    "z upside down": (frame(sign=(1.0, 1.0, -1.0), stiff=True), "upward motion along -z"),
    "body turned by 90": (frame(turned=0.5 * pi), "turned by -90 deg"),
    "body turned by 180": (frame(turned=pi), "turned by 180 deg"),
    # the attitude changes too: by the first motion it may also be a turn
    "x and y exchanged": (frame((1, 0, 2)), "`axes`"),
    "exchanged, the attitude right": (frame((1, 0, 2), stiff=True), "x and y exchanged"),
    "y mirrored": (frame(sign=(1.0, -1.0, 1.0)), "`axes`"),
    "y mirrored, the attitude right": (frame(sign=(1.0, -1.0, 1.0), stiff=True), "y mirrored"),
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_frame_is_told_in_half_a_second_with_what_explains_it(name, seed):
    change, words = WRONG[name]
    draw = random.Random(f"{name} {seed}")
    (one, slow), (two, fast), up = (
        (draw.uniform(0.3, 0.6), draw.uniform(2.5, 3.5)) for _ in range(3)
    )
    heading = draw.uniform(-0.5, 0.5)
    # less along x, so that an exchange of the two can't pass for a turn
    swings = ((0.3 * one, slow), (-two, fast), up)
    motion = Motion(swings, heading)
    found, when = told(motion, change)
    assert found is not None
    assert norm(motion.velocity(when - 0.5)) <= 0.3
    assert words in found.reason
    assert "check the stream's" in found.reason
    assert found.value > found.bound


def jitter(rng):
    """Poses are up to 0.15 s late, samples up to 0.05 s."""
    return lambda k: (rng.randrange(7), rng.randrange(20))


def bursts(rng):
    """Nothing arrives for 0.1 to 0.25 s, then all of it."""
    until = [0]

    def late(k):
        if k >= until[0]:
            until[0] = k + rng.randrange(12, 32)
        return 0, until[0] - k

    return late


def late_samples(rng):
    """The link to the vehicle is late by 0.1 s, and motion capture isn't."""
    return lambda k: (10 + rng.randrange(5), 0)


def gaps(rng):
    """Half of the poses never arrive, and all others are late."""
    return lambda k: (0, None if rng.random() < 0.5 else 5 + rng.randrange(10))


STREAMS = {
    "jitter": (jitter, 0.0),
    "bursts": (bursts, 0.0),
    "late samples": (late_samples, 0.0),
    "gaps": (gaps, 0.0),
    "fast clock": (jitter, 2e-3),
    "slow clock": (jitter, -2e-3),
}


@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize("seed", range(4))
def test_late_streams_in_the_right_frame_raise_no_alarm_and_are_compared(name, seed):
    kind, drift = STREAMS[name]
    draw, bounds = random.Random(f"{name} {seed}"), []
    swings = tuple((draw.uniform(0.1, 0.6), draw.uniform(1.0, 3.0)) for _ in range(3))
    found, when = told(
        Motion(swings, draw.uniform(-pi, pi)), frame(turned=radians(30.0), factor=0.9),
        late=kind(draw), drift=drift, bounds=bounds,
    )  # fmt: skip
    assert found is None, (when, found)
    assert max(bounds) < 0.9 * MAX_UNCOMPARED_S


@pytest.mark.parametrize("wrong", ["metres read as mm", "y mirrored", "body turned by 180"])
@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize("seed", range(2))
def test_a_wrong_frame_is_told_however_late_its_poses_are(name, wrong, seed):
    kind, drift = STREAMS[name]
    draw = random.Random(f"{name} {wrong} {seed}")
    swings = ((0.3, 3.0), (-0.5, 2.8), (0.5, 2.6))
    motion = Motion(swings, draw.uniform(-0.5, 0.5))
    found, when = told(motion, WRONG[wrong][0], late=kind(draw), drift=drift)
    assert found is not None
    assert when < 0.9, "half a second after the motion shows it, and the delay"


@pytest.mark.parametrize("seed", [3, 6, 11])
@pytest.mark.parametrize(("factor", "tells"), [(0.9, False), (1e-3, True)])
def test_samples_that_late_ticks_make_long_are_no_motion(factor, tells, seed):
    """A computer under load: one sample in thirty lasts 0.03 to 0.12 s."""
    draw, check = random.Random(seed), FrameCheck()
    motion, t = Motion(((0.3, 2.0), (0.4, 2.5), (0.5, 2.0))), -1.0
    while t < 4.0:
        dt = draw.uniform(0.03, 0.12) if draw.random() < 1 / 30 else 0.008
        t += dt
        steps = [t - dt * (i + 0.5) / 20 for i in range(20)]
        forces = [
            rotate_back(motion.attitude(s), add(motion.acceleration(s), (0.0, 0.0, GRAVITY)))
            for s in steps
        ]
        force = scale(tuple(map(sum, zip(*forces, strict=True))), 0.05)
        _, x, y, z = multiply(conjugate(motion.attitude(t - dt)), motion.attitude(t))
        time = round((t + 2.0) * NS)
        check.add_imu(Imu(time, dt, force, scale((x, y, z), 2.0 / dt)))
        place = scale(motion.position(t), factor)
        check.add_poses([Pose(time, place, motion.attitude(t))], t > 0.0)
        if check.wrong is not None:
            break
    assert (check.wrong is not None) is tells, check.wrong


@pytest.mark.parametrize("lost_of_ten", [0, 6])
def test_poses_that_cannot_be_compared_are_counted_until_they_can(lost_of_ten):
    bounds = []
    motion = Motion(((0.3, 2.0), (0.2, 1.5), (0.4, 1.0)))
    told(motion, lost=lambda k: k > 2 * RATE * REST and k % 10 < lost_of_ten, bounds=bounds)
    assert (max(bounds) > MAX_UNCOMPARED_S) is (lost_of_ten > 0)


@pytest.mark.parametrize("size", [0.01, 0.02, 0.04, 0.1, 0.4])
def test_a_jump_of_the_poses_is_none_of_a_frame(size):
    """Once and for all, then back: an origin set anew."""
    motion = Motion(((0.3, 2.0), (0.2, 1.5), (0.4, 1.0)))
    jumped = [0]

    def change(place, attitude):
        jumped[0] += 1
        return add(place, (size if jumped[0] % 200 > 100 else 0.0, 0.0, 0.0)), attitude

    assert told(motion, change)[0] is None


def test_poses_noisier_than_any_wrong_frame_are_not_judged():
    assert told(Motion(((0.3, 2.0), (0.2, 1.5), (0.4, 1.0))), noise=0.03)[0] is None


def test_lost_imu_samples_are_no_motion():
    motion = Motion(((0.5, 3.0), (0.4, 2.5), (0.5, 2.0)))
    assert told(motion, lost=lambda k: k % 60 > 40)[0] is None


@pytest.mark.parametrize("seconds", [1.2, 4.0])
def test_what_the_imu_integrates_while_poses_are_lost_is_not_compared(seconds: float) -> None:
    """As while kybflow hangs: the rates of an autopilot are samples, of which most are left out."""
    check = FrameCheck()
    for k in range(round((REST + seconds + 2.0) * RATE)):
        t, time = k / RATE - REST, NS + round(k * NS / RATE)
        is_lost = 0.5 < t < 0.5 + seconds
        check.add_imu(Imu(time, 1.0 / RATE, (0.0, 0.0, GRAVITY), (0.4 * is_lost, 0.0, 0.0)))
        check.add_poses([] if is_lost else [Pose(time, (0.0, 0.0, 1.0), LEVEL)], t > 0.0)
    assert check.wrong is None


def test_an_imu_that_is_mounted_askew_is_levelled_at_rest():
    motion = Motion(((0.5, 3.0), (0.4, 2.5), (0.5, 2.0)))
    assert told(motion, mount=from_euler(0.2, -0.1, 0.0))[0] is None


def test_an_autopilot_that_lifts_off_before_it_follows_commands_is_not_at_rest():
    """What its IMU feels in the climb is no bias."""
    motion, check = Motion(((0.0, 1.0), (0.0, 1.0), (0.4, 2.5))), FrameCheck()
    for k in range(1, 250):
        time, t = k * NS // 100, (k - 50) / 100
        force = (0.0, 0.0, GRAVITY + motion.acceleration(t - 0.005)[2])
        check.add_imu(Imu(time, 0.01, force, ZERO))
        check.add_poses([Pose(time, motion.position(t), LEVEL)], rotors_turn=t > 0.5)
        assert check.wrong is None


@pytest.mark.parametrize(("factor", "tells"), [(1.0, False), (1e-3, True)])
def test_a_slow_imu_misses_blows_and_still_tells_a_wrong_unit(factor, tells):
    """It touches down between two samples of 25 a second; then it climbs faster and faster."""
    check = FrameCheck()
    for k in range(1, 400):
        time, t = k * NS // 100, (k - 50) / 100
        climbs = max(t - 2.0, 0.0)
        height = 0.5 - 0.5 * min(max(t, 0.0), 1.0) + climbs**3 / 3.0
        if k % 4 == 0:
            check.add_imu(Imu(time, 0.04, (0.0, 0.0, GRAVITY + 2.0 * climbs), ZERO))
        check.add_poses([Pose(time, (0.0, 0.0, factor * height), LEVEL)], rotors_turn=t > -0.1)
        if t < 2.0:
            assert check.wrong is None
    assert (check.wrong is not None) is tells


@pytest.mark.parametrize(
    ("factor", "awaits", "tells"),
    [(1.0, True, False), (1.0, False, True), (1e-3, True, True)],
)
def test_in_the_land_mode_of_an_autopilot_a_blow_that_fine_samples_miss_is_no_wrong_frame(
    factor: float, awaits: bool, tells: bool
) -> None:
    """It sinks, touches down between two samples, and later climbs faster and faster."""
    check = FrameCheck()
    for k in range(1, 400):
        time, t = k * NS // 100, (k - 50) / 100
        climbs = max(t - 2.0, 0.0)
        height = 0.7 - 0.7 * min(max(t, 0.0), 1.0) + climbs**3 / 3.0
        check.add_imu(Imu(time, 0.01, (0.0, 0.0, GRAVITY + 2.0 * climbs), ZERO))
        pose = Pose(time, (0.0, 0.0, factor * height), LEVEL)
        check.add_poses([pose], t > -0.1, awaits and t < 2.0)
        if awaits and t < 2.0:
            assert check.wrong is None
    assert (check.wrong is not None) is tells


def test_it_ends_at_rest_and_knows_the_slant_of_the_body():
    check = FrameCheck()
    slanted = from_euler(radians(20.0), 0.0, 0.5)
    for k in range(1, 30):
        time = k * NS // 100
        imu = Imu(time, 0.01, (0.0, 0.0, GRAVITY), ZERO)
        check.add_imu(imu)
        check.add_poses([Pose(time, ZERO, slanted)], rotors_turn=False)
    assert check.slant == pytest.approx(radians(20.0))
    assert check.is_judged
    assert check.wrong is None


def test_the_velocity_is_what_the_imu_integrates_to_in_the_heading_of_the_vehicle():
    motion, check = Motion(((0.6, 2.0), (0.0, 1.0), (0.3, 2.0)), heading=0.5 * pi), FrameCheck()
    for k in range(1, 150):
        time, t = k * NS // 100, (k - 50) / 100
        q = motion.attitude(t - 0.005)
        force = rotate_back(q, add(motion.acceleration(t - 0.005), (0.0, 0.0, GRAVITY)))
        _, x, y, z = multiply(conjugate(motion.attitude(t - 0.01)), motion.attitude(t))
        check.add_imu(Imu(time, 0.01, force, scale((x, y, z), 200.0)))
        check.add_poses([Pose(time, scale(motion.position(t), 1e-3), q)], t > 0.0)
    assert check.wrong is not None
    ahead, left, up = check.motion(149 * NS // 100).velocity
    turned = 0.3 * sin(0.99)
    x, _, z = motion.velocity(0.99)
    assert ahead == pytest.approx(x * sin(-turned), abs=0.1)
    assert left == pytest.approx(-x * cos(turned), abs=0.1)
    assert up == pytest.approx(z, abs=0.1)
    soon, late = (149 * NS // 100 + age for age in (NS // 20, 2 * NS))
    assert (check.is_current(soon), check.is_current(late)) == (True, False)
    assert check.motion(late) == check.motion(late + 2 * NS)


@pytest.mark.parametrize("begins", [0.0, 8.0])
@pytest.mark.parametrize("wrong", ["y mirrored", "x and y exchanged"])
def test_wrong_poses_hardly_change_the_velocity_by_the_imu(wrong: str, begins: float):
    """Neither before the frame is found to be wrong nor after; whether it is wrong from the
    take-off or becomes so in a flight in which it was confirmed."""
    motion, check = Motion(((0.0, 1.0), (0.8, 2.0), (0.3, 2.0))), FrameCheck()
    change, _ = WRONG[wrong]
    for k in range(1, 250 + round(100 * begins)):
        time, t = k * NS // 100, (k - 50) / 100
        q = motion.attitude(t - 0.005)
        force = rotate_back(q, add(motion.acceleration(t - 0.005), (0.0, 0.0, GRAVITY)))
        _, x, y, z = multiply(conjugate(motion.attitude(t - 0.01)), motion.attitude(t))
        check.add_imu(Imu(time, 0.01, force, scale((x, y, z), 200.0)))
        place = motion.position(t)
        check.add_poses([Pose(time, *(change(place, q) if t >= begins else (place, q)))], t > 0.0)
        if check.wrong is not None:
            (x, y, z), turned = motion.velocity(t), 0.3 * sin(t)
            ahead, left = x * cos(turned) + y * sin(turned), y * cos(turned) - x * sin(turned)
            assert check.motion(time).velocity == pytest.approx((ahead, left, z), abs=0.15)
    assert check.wrong is not None


def test_a_frame_is_confirmed_after_seconds_of_flight():
    check = FrameCheck()
    for k in range(1, 800):
        time = k * NS // 100
        check.add_imu(Imu(time, 0.01, (0.0, 0.0, GRAVITY), ZERO))
        check.add_poses([Pose(time, ZERO, LEVEL)], rotors_turn=k > 50)
        if k in (50, 500):
            assert not check.is_confirmed
    assert check.is_confirmed


def test_what_nothing_explains_names_all_that_may_be_wrong():
    reason = explained([((3.0, 1.0, -2.0), (1.0, 2.0, 0.5)), ((-3.0, 1.0, 2.0), (1.0, 2.0, 0.5))])
    assert "disagree" in reason
    assert all(word in reason for word in ("units", "axes", "heading"))


@pytest.mark.parametrize("rate", [1.2, 3.0])
def test_a_gyroscope_that_drifts_in_a_long_flight_is_corrected_without_bound(rate: float):
    """By 1.2 deg/s, as one that is sampled too seldom, or by more, as one whose bias jumps."""
    motion, check = Motion(((0.5, 1.0), (0.3, 0.7), (0.2, 1.5))), FrameCheck()
    for k in range(1, 2000):
        time, t = k * NS // 100, (k - 50) / 100
        q = motion.attitude(t - 0.005)
        force = rotate_back(q, add(motion.acceleration(t - 0.005), (0.0, 0.0, GRAVITY)))
        _, x, y, z = multiply(conjugate(motion.attitude(t - 0.01)), motion.attitude(t))
        drift = radians(rate) if t > 8.0 else 0.0
        check.add_imu(Imu(time, 0.01, force, (200.0 * x + drift, 200.0 * y, 200.0 * z)))
        check.add_poses([Pose(time, motion.position(t), motion.attitude(t))], t > 0.0)
    assert check.wrong is None
