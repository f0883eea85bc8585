"""The law of a descent by the IMU alone: how fast, how long, and that it does not climb."""

from __future__ import annotations

import random
from collections import deque
from math import ceil, cos, hypot, sin, tan
from typing import NamedTuple

import pytest
from part_bench import AIRFRAME

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import InertialMotion
from kybflow.flight.descent import BlindBrake, Descent

MASS, MOST, ROTOR_TIME = 0.230, 5.2, 0.03
LONGEST = 0.004
"""Of a step of the physics, s."""
QUIET, PX4_SIH = 0.07, 1.4
"""Noise of a sample, m/s^2: of the simulator here, and of PX4's, along z
(PX4-Autopilot, `simulator_sih/sih.cpp`)."""
HEIGHTS = (0.5, 1.0, 1.5, 2.5)
ERRORS = (-0.1, 0.0, 0.1)
BUMP, BUMP_TIME = 30.0, 0.024
"""Specific force of a wall's edge under a rotor, m/s^2, and how long it lasts, s."""


class Fall(NamedTuple):
    """speed: of the first touch of the floor, m/s. touched, stopped: when, s. climbed: above the
    start, m. rose: above the lowest point before, until the first touch, m."""

    speed: float
    touched: float
    stopped: float
    climbed: float
    rose: float = 0.0


def fall(
    height: float,
    error: float = 0.0,
    *,
    bias: float = 0.0,
    climb: float = 0.0,
    unknown: float = 0.0,
    dt: float = 0.004,
    seed: int = 0,
    sigma: float = QUIET,
    unsure: float = 0.1,
    bumps: tuple[float, ...] = (),
    late: float = 0.0,
    told: bool = True,
) -> Fall:
    """A body whose thrust is wrong by `error` over a stiff floor; `unknown` is a vertical speed at
    the beginning that nobody knows of. At each of `bumps`, s, something else strikes it upwards.
    late: by how much commands take effect later, s. told: whether the law knows."""
    noise = random.Random(seed)
    descent = Descent(MASS * GRAVITY, MOST, climb, unsure=unsure, late=late if told else 0.0)
    z, v, top, touch = height, climb + unknown, height, None
    low, rose = height, 0.0
    thrust = MASS * GRAVITY
    commands = deque([thrust] * (1 + round(late / dt)))
    parts = ceil(dt / LONGEST)
    h = dt / parts
    for step in range(round(40.0 / dt)):
        struck = BUMP if any(at <= step * dt < at + BUMP_TIME for at in bumps) else 0.0
        for part in range(parts):
            thrust += (commands[0] - thrust) * h / ROTOR_TIME
            lift = (1.0 + error) * thrust / MASS
            if z <= 0.0:
                touch = touch or (-v, step * dt + part * h)
                lift += max(-2e4 * z - 200.0 * v, 0.0)
            lift += struck
            v += (lift - GRAVITY) * h
            z += v * h
            top, low = max(top, z), min(low, z)
            rose = rose if touch else max(rose, z - low)
        given = descent.step(lift + bias + noise.gauss(0.0, sigma), dt)
        if given is None:
            assert touch is not None, "the rotors stopped in the air"
            return Fall(*touch, (step + 1) * dt, top - height, rose)
        commands.append(given)
        commands.popleft()
    raise AssertionError("it did not come down")


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("height", HEIGHTS)
def test_it_comes_down_gently_whatever_is_wrong_with_the_thrust(height, error):
    speed, touched, stopped, climbed, _ = fall(height, error)
    assert speed < 1.05
    assert touched < 4.2
    assert stopped - touched < 0.25
    assert climbed < 0.005


@pytest.mark.parametrize("late", [0.06, 0.1, 0.15])
@pytest.mark.parametrize("height", HEIGHTS)
def test_late_commands_that_it_knows_of_do_not_make_it_swing(height, late):
    knows, guesses = fall(height, late=late), fall(height, late=late, told=False)
    assert knows.speed < 1.05
    assert knows.rose < 0.005
    assert late < 0.1 or guesses.rose > 0.005 or guesses.speed > knows.speed


@pytest.mark.parametrize("bias", [-0.25, -0.15, 0.15, 0.25])
@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("height", HEIGHTS)
def test_a_wrong_accelerometer_neither_holds_it_up_nor_drops_it(height, error, bias):
    speed, _, stopped, climbed, _ = fall(height, error, bias=bias)
    assert speed < 1.51
    assert stopped < 11.0
    assert climbed < 0.01


@pytest.mark.parametrize("climb", [-1.0, -0.5, 0.5, 1.0])
def test_the_speed_of_entry_is_taken_away(climb):
    speed, _, _, climbed, _ = fall(1.5, climb=climb)
    assert speed < 1.0
    assert climbed < max(0.5 * climb * abs(climb) / 2.0 + 0.06, 0.01)


@pytest.mark.parametrize("unknown", [-0.3, 0.3])
def test_a_speed_of_entry_that_is_not_known_does_little(unknown):
    speed, _, _, climbed, _ = fall(1.5, unknown=unknown)
    assert speed < 1.0
    assert climbed < 0.06


@pytest.mark.parametrize("bias", [-3.0, -1.0, -0.5])
def test_whatever_the_imu_says_it_comes_down_in_the_end(bias):
    assert fall(1.0, bias=bias).stopped < 35.0


@pytest.mark.parametrize(("bias", "most"), [(-0.5, 0.05), (-0.75, 0.35), (-1.0, 0.6)])
@pytest.mark.parametrize("height", HEIGHTS)
def test_by_a_hover_thrust_that_was_learnt_no_accelerometer_makes_it_climb(height, bias, most):
    landing = fall(height, bias=bias, unsure=0.0)
    assert landing.climbed < most
    assert landing.speed < 1.5


def test_rotors_that_weaken_as_much_as_no_accelerometer_errs_are_believed():
    assert fall(1.0, -0.2, unsure=0.0).speed < 0.8


@pytest.mark.parametrize("unknown", [0.0, 0.2])
@pytest.mark.parametrize("error", ERRORS)
def test_in_the_noise_of_px4s_simulator_it_does_not_rise_again(error, unknown):
    falls = [
        fall(2.5, error, unknown=unknown, dt=0.01, seed=seed, sigma=PX4_SIH)
        for seed in range(500, 520)
    ]
    assert max(f.rose for f in falls) <= 0.1
    assert max(f.speed for f in falls) < 1.8


def test_noise_and_a_calibrated_accelerometers_bias_do_not_make_it_rise_again():
    falls = [fall(2.5, bias=-0.05, dt=0.01, seed=s, sigma=PX4_SIH) for s in range(500, 520)]
    assert max(f.rose for f in falls) <= 0.1


def test_rotors_that_are_a_third_too_weak_are_made_up_for():
    assert fall(1.0, -0.35).speed < 0.8


def test_a_vehicle_that_has_lost_half_its_mass_is_not_taken_for_one_on_the_floor():
    assert fall(1.5, 0.75).speed < 1.0


@pytest.mark.parametrize("height", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("error", [-0.35, 0.0])
def test_a_floor_that_is_met_at_once_stops_it_too(height, error):
    landing = fall(height, error, climb=-0.5)
    assert landing.stopped < 1.5
    assert landing.climbed < 0.05


def test_at_the_rate_of_the_physics_it_is_the_same():
    slow, fast = fall(1.5), fall(1.5, dt=0.002)
    assert fast.speed == pytest.approx(slow.speed, abs=0.03)
    assert fast.touched == pytest.approx(slow.touched, abs=0.05)


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("at", [0.25, 0.8, 1.5])
@pytest.mark.parametrize("again", [0.05, 0.4])
def test_a_bump_in_the_air_is_not_the_floor(at, again, error):
    """`fall` fails if the rotors stop in the air."""
    landing = fall(1.8, error, bumps=(at, at + again))
    assert landing.speed < 1.8
    assert landing.climbed < 0.3
    assert landing.stopped - landing.touched < 0.3
    assert landing.stopped < 5.0


@pytest.mark.parametrize("height", HEIGHTS)
def test_a_bump_close_above_the_floor_does_not_hide_the_floor(height):
    reached = fall(height).touched
    for before in (0.02, 0.1, 0.2, 0.3):
        landing = fall(height, bumps=(reached - before,))
        assert landing.stopped < reached + 1.5


@pytest.mark.parametrize("direction", [0.0, 2.0, -1.3])
@pytest.mark.parametrize("speed", [0.3, 0.9])
def test_a_brake_stops_where_its_tilt_allows_and_levels_then(direction, speed):
    """A body with the airframe's drag and twice the lag of its attitude loop."""
    x, y = speed * cos(direction), speed * sin(direction)
    brake = BlindBrake((x, y), (0.0, 0.0), AIRFRAME)
    loop, dt, gone = AIRFRAME.attitude_loop, 0.004, 0.0
    lag = 2.0 * loop.derivative / loop.proportional
    vx, vy, ax, ay = x, y, AIRFRAME.drag * x, AIRFRAME.drag * y
    for _ in range(round(1.5 / dt)):
        asked = brake.step(dt)
        cx, cy, up = asked or (0.0, 0.0, GRAVITY)
        assert hypot(cx, cy) <= up * tan(AIRFRAME.tilt) * 1.001
        assert cx * x + cy * y <= 0.0
        ax, ay = ax + (cx - ax) * dt / lag, ay + (cy - ay) * dt / lag
        vx, vy = vx + (ax - AIRFRAME.drag * vx) * dt, vy + (ay - AIRFRAME.drag * vy) * dt
        gone += max(vx * x + vy * y, 0.0) / speed * dt
    assert asked is None
    assert brake.lean == pytest.approx(1.0, abs=1e-3)
    assert hypot(vx, vy) < 0.1
    assert gone < 0.25 * speed + speed**2 / (2.0 * 2.0) + 0.1


def test_a_brake_holds_a_measured_velocity_at_rest():
    """A vehicle that is a few degrees off level, which the model of the brake doesn't know."""
    brake, dt, v, off = BlindBrake((0.0, 0.0), (0.0, 0.0), AIRFRAME), 0.01, 0.0, 0.4
    for _ in range(300):
        brake.measure(InertialMotion((0.0, v, 0.0), (0.0, off, 0.0)))
        _, pull, _ = brake.step(dt) or (0.0, 0.0, GRAVITY)
        v += (pull + off) * dt
    assert v == pytest.approx(off / 3.0, abs=0.02)


def test_a_velocity_that_the_airframe_does_not_have_is_not_believed():
    brake = BlindBrake((30.0, 0.0), (0.0, 0.0), AIRFRAME)
    steps = 0
    while brake.step(0.004) is not None:
        steps += 1
    assert steps * 0.004 < 2.5


def test_its_thrust_never_exceeds_what_the_rotors_have():
    descent = Descent(10.0, 5.0, -2.0)
    assert descent.step(0.0, 0.004) == pytest.approx(5.0)


@pytest.mark.slow
def test_over_all_seeds():
    falls = [
        fall(height, error, bias=random.Random(seed).gauss(0.0, 0.07), seed=seed)
        for seed in range(40)
        for height in HEIGHTS
        for error in ERRORS
    ]
    assert max(f.speed for f in falls) < 1.5
    assert max(f.climbed for f in falls) < 0.01


def test_a_measured_blow_leans_no_more_than_the_airframe():
    brake = BlindBrake((0.0, 0.0), (0.0, 0.0), AIRFRAME)
    brake.measure(InertialMotion((0.0, 0.0, 0.0), (60.0, 0.0, 0.0)))
    assert brake.lean == pytest.approx(cos(AIRFRAME.tilt))
