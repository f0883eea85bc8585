"""No number that an autopilot says, or that a bad line makes of it, becomes what is flown by."""

from __future__ import annotations

from copy import copy
from math import inf, isfinite, nan

from scripted_autopilot import BOTH, Bench, at, estimate, mavlink, standing

from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, Imu, Odometry
from kybflow.drivers.mavlink.control.hover_throttle import USUAL_THROTTLE, HoverThrottle

MS = 1_000_000
FLOATS = ("float", "double")
RATES = (0.0, 0.0, 0.0)


def samples(ms: int, name: str) -> list:
    """One of each sort that has floats and that is listened to."""
    hover = {"px4": b"MPC_THR_HOVER", "ardupilot": b"MOT_THST_HOVER"}[name]
    danger = {"px4": b"COM_OF_LOSS_T", "ardupilot": b"FS_GCS_TIMEOUT"}[name]
    output = {"px4": b"PWM_MAIN_FUNC5", "ardupilot": b"SERVO9_FUNCTION"}[name]
    enabled = {"px4": b"COM_OBL_RC_ACT", "ardupilot": b"FS_GCS_ENABLE"}[name]
    return [
        mavlink.MAVLink_attitude_quaternion_message(ms, 1.0, *RATES, *RATES),
        mavlink.MAVLink_local_position_ned_message(ms, *RATES, *RATES),
        mavlink.MAVLink_estimator_status_message(ms * 1000, 831, *(0.0,) * 6, 0.03, 0.03),
        mavlink.MAVLink_ekf_status_report_message(831, *(0.05,) * 5),
        mavlink.MAVLink_highres_imu_message(
            ms * 1000, 0.0, 0.0, -9.8, *RATES, *RATES, 950.0, 0.0, 1.0, 20.0, 63
        ),
        mavlink.MAVLink_attitude_target_message(ms, 0, [1.0, 0.0, 0.0, 0.0], *RATES, 0.5),
        mavlink.MAVLink_sim_state_message(
            1.0, *RATES, *RATES, 0.0, 0.0, -9.8, *RATES, 47.0, 8.0, 488.0, 0.1, 0.1, *RATES
        ),
        mavlink.MAVLink_hil_state_quaternion_message(
            ms * 1000, [1.0, 0.0, 0.0, 0.0], *RATES, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
        ),
        *(
            mavlink.MAVLink_param_value_message(parameter, 1.0, 9, 1, 0)
            for parameter in (hover, danger, enabled, output)
        ),
    ]  # fmt: skip


def spoilt(message) -> list:
    """The message with each of its floats wrong, one at a time."""
    found = []
    for field, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
        if kind not in FLOATS:
            continue
        value = getattr(message, field)
        for bad in (nan, inf, -inf, 3e38):
            wrong = copy(message)
            many = isinstance(value, (list, tuple))
            setattr(wrong, field, [bad, *value[1:]] if many else bad)
            found.append(wrong)
    return found


def numbers(value):
    if isinstance(value, float):
        yield value
    elif isinstance(value, tuple):
        for one in value:
            yield from numbers(one)


def floats_in(message):
    made = mavlink.mavlink_map[message.get_msgId()]
    for field, kind in zip(made.fieldnames, made.fieldtypes, strict=True):
        value = getattr(message, field)
        if kind in FLOATS and message.get_type() != "COMMAND_LONG":
            yield from value if isinstance(value, (list, tuple)) else (value,)


def flying(name: str) -> Bench:
    bench = standing(name, simulator=True)
    for _ in range(50):
        bench.tick()
        bench.link.tell_position(estimate(bench.now), bench.now)
    bench.fly()
    return bench


@BOTH
def test_what_is_not_finite_goes_no_further(name):
    bench = flying(name)
    for message in [wrong for one in samples(0, name) for wrong in spoilt(one)]:
        for field, unit in (("time_boot_ms", MS), ("time_usec", 1000)):
            if hasattr(message, field):
                setattr(message, field, bench.now // unit)
        bench.fake.send(message)
        bench.measured.clear()
        bench.fake.sent.clear()
        bench.tick()
        bench.link.tell_position(estimate(bench.now), bench.now)
        bench.link.send(at((0.0, 0.0, 1.0)), bench.now)
        bench.link.prepare_preflight(bench.now)
        bench.link.checks(bench.now)
        out = [*bench.measured, bench.link.truth() or ()]
        assert all(isfinite(one) for value in out for one in numbers(value)), message
        sent = [one for told in bench.fake.sent for one in floats_in(told)]
        assert all(map(isfinite, sent)), message


def test_a_throttle_that_is_no_number_is_not_flown_with():
    throttle = HoverThrottle("MPC_THR_HOVER", 10.0, False).throttle({"MPC_THR_HOVER": nan})
    assert throttle.hover == USUAL_THROTTLE


def test_an_attitude_that_is_none_is_left_out():
    bench = flying("px4")
    for index in range(10):
        stamp = bench.now // MS + index
        bench.fake.send(mavlink.MAVLink_attitude_quaternion_message(stamp, 0.0, *RATES, *RATES))
        bench.tick()
        bench.link.send(at(ZERO), bench.now)
    assert all(sum(q * q for q in m.attitude) > 0.9 for m in bench.measured if type(m) is Odometry)


def test_inertial_measurements_go_on_after_a_bad_one():
    bench = flying("px4")
    for index in range(5):
        bench.run(0.02, at(ZERO))
        bad = nan if index == 2 else 0.0
        bench.fake.send(
            mavlink.MAVLink_highres_imu_message(
                bench.now // 1000, bad, 0.0, -9.8, *RATES, *RATES, 950.0, 0.0, 1.0, 20.0, 63
            )
        )
    bench.run(0.02, at(ZERO))
    felt = [m for m in bench.measured if type(m) is Imu]
    assert len(felt) >= 3
    assert all(isfinite(one) for one in numbers(tuple(felt)))
    assert felt[-1].time <= bench.now < NS * 60
