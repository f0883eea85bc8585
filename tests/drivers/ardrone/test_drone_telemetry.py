"""What a drone says becomes measurements in SI, ENU and FLU, stamped in the run's time."""

from __future__ import annotations

import random
from math import degrees, pi

import pytest
from part_bench import SITE

from kybflow.core.geometry import GRAVITY, to_euler
from kybflow.core.signals import NS, Battery, Imu, Odometry
from kybflow.drivers.ardrone import navdata
from kybflow.drivers.ardrone.navdata import WRAP_S, DroneState, Packet, Phase
from kybflow.drivers.ardrone.telemetry import DroneClock, Measurements

CONTEXT = SITE._replace(start=(1.0, 2.0, 0.0), heading=pi / 2)
PERIOD = NS // 200


def packet(number, *, state=DroneState.FLYING, battery=80, velocity=(0.0, 0.0, 0.0), **angles):
    turned = {"pitch": 0.0, "roll": 0.0, "heading": 30_000.0, "altitude": 1000, **angles}
    options = dict([
        navdata.write_demo(navdata.Demo(Phase.FLYING, battery, velocity=velocity, **turned)),
        navdata.write_time(number * 5000),
        navdata.write_phys_measures(
            navdata.PhysMeasures((100.0, 200.0, -1000.0), (10.0, 20.0, 30.0))
        ),
        navdata.write_raw_measures(11_500),
    ])  # fmt: skip
    return Packet(state, number, 0, options)


def heard(*packets):
    measurements = Measurements(CONTEXT)
    for number, one in enumerate(packets):
        measurements.receive(one, number * PERIOD)
    return measurements.take()


def of(kind, measured):
    return [one for one in measured if isinstance(one, kind)]


def test_the_inertial_sensors_are_turned_and_timed_by_the_drones_clock():
    felt = of(Imu, heard(packet(1), packet(3)))  # one was lost
    assert [imu.dt for imu in felt] == pytest.approx([0.01])
    assert felt[0].specific_force == pytest.approx((0.1 * GRAVITY, -0.2 * GRAVITY, GRAVITY))
    assert [degrees(rate) for rate in felt[0].angular_velocity] == pytest.approx([10, -20, -30])


def test_the_battery_is_told_when_it_changes_with_the_drones_own_warning():
    low = DroneState.FLYING | DroneState.BATTERY_LOW
    told = of(Battery, heard(packet(1), packet(2), packet(3, battery=15, state=low)))
    assert [battery.remaining for battery in told] == [0.8, 0.15]
    assert told[0].voltage == pytest.approx(11.5)
    assert told[0].warning is None
    assert told[1].warning.acts


def test_its_own_motion_begins_at_the_start_and_is_summed_up():
    standing = packet(0, state=DroneState(0), altitude=0)
    way = [packet(n, velocity=(1000.0, 0.0, -100.0), heading=30_000.0) for n in range(1, 201)]
    *_, last = of(Odometry, heard(standing, *way))
    assert last.position == pytest.approx((1.0, 3.0, 1.0), abs=0.02)  # forward is north
    assert last.velocity == pytest.approx((0.0, 1.0, 0.1), abs=1e-6)
    assert to_euler(last.attitude)[2] == pytest.approx(pi / 2)
    assert last.spread == pytest.approx(0.15, abs=0.01)
    *_, turned = of(
        Odometry, heard(standing, packet(1, heading=50_000.0, roll=5_000.0, pitch=3_000.0))
    )
    roll, pitch, yaw = map(degrees, to_euler(turned.attitude))
    assert (roll, pitch, yaw) == pytest.approx((5.0, -3.0, 70.0), abs=1e-3)  # clockwise is less


def test_what_is_not_finite_is_left_out():
    broken = packet(2, pitch=float("nan"))
    assert len(of(Odometry, heard(packet(1), broken))) == 1


def test_packets_that_jitter_are_stamped_evenly():
    clock, chance, arrived = DroneClock(), random.Random(0), 0
    for number in range(1000):
        sent = number * PERIOD
        arrived = max(arrived, sent + round(chance.uniform(0.0, 0.04) * NS))
        stamp = clock.stamp(500.0 + sent / NS, arrived)
        assert stamp <= arrived
        assert number < 200 or abs(stamp - sent) < NS // 100
        assert clock.dt == pytest.approx(0.0 if number == 0 else 0.005)


@pytest.mark.parametrize("there", [lambda t: (WRAP_S - 1.0 + t) % WRAP_S, lambda t: t % 3.0])
def test_a_clock_that_wraps_or_starts_again_is_followed(there):
    clock = DroneClock()
    off = [
        number * PERIOD - clock.stamp(there(number * PERIOD / NS), number * PERIOD)
        for number in range(1000)
    ]
    assert max(off) <= PERIOD
    assert clock.dt == pytest.approx(0.005)


def test_a_silence_moves_no_stamp_and_is_no_step():
    clock = DroneClock()
    for number in range(400):
        clock.stamp(number / 200, number * PERIOD)
    clock.stamp(None, 3 * NS)
    assert clock.stamp(4.0, 4 * NS) == 4 * NS
    assert clock.dt == 0.0


def test_a_packet_without_a_time_counts_as_sent_now():
    clock = DroneClock()
    assert clock.stamp(None, NS) == NS
    assert clock.stamp(None, NS + NS // 15) == NS + NS // 15
    assert clock.dt == pytest.approx(1 / 15)
