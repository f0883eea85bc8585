"""The stamps of a drone's packets in the run's time: by its own clock, by the least delay."""

from __future__ import annotations

import random

import pytest

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.navdata import WRAPS
from kybflow.drivers.ardrone.telemetry import DroneClock

PERIOD = NS // 200


def test_packets_that_jitter_are_stamped_evenly():
    clock, chance, arrived = DroneClock(), random.Random(0), 0
    for number in range(1000):
        sent = number * PERIOD
        arrived = max(arrived, sent + round(chance.uniform(0.0, 0.04) * NS))
        stamp = clock.stamp(500.0 + sent / NS, arrived)
        assert stamp <= arrived
        assert number < 200 or abs(stamp - sent) < NS // 100
        assert clock.dt == pytest.approx(0.0 if number == 0 else 0.005)


@pytest.mark.parametrize("there", [lambda t: (WRAPS - 1.0 + t) % WRAPS, lambda t: t % 3.0])
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
