"""Which datagrams count as the drone's."""

from __future__ import annotations

from random import Random

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.navdata import DroneState, write_packet
from kybflow.drivers.ardrone.wire import Gate


def test_what_is_foreign_broken_or_old_is_counted():
    gate = Gate()
    good = write_packet(DroneState.DEMO, 5)
    assert gate.admit(good, True, 0) is not None
    assert gate.admit(write_packet(DroneState.DEMO, 6), False, 1) is None
    assert gate.admit(good, True, 2) is None
    assert gate.admit(good[:-1] + b"\x99", True, 3) is None
    assert gate.refused == {"from elsewhere": 1, "not newer": 1, "a wrong checksum": 1}


def test_what_is_refused_is_told_at_ten_and_ten_times_that():
    gate = Gate()
    told = []
    for _ in range(120):
        gate.admit(b"", False, 0)
        told.append(gate.report())
    assert [text for text in told if text] == [
        "10 datagrams were ignored: 10 from elsewhere",
        "100 datagrams were ignored: 100 from elsewhere",
    ]


def test_numbers_begin_anew_after_a_silence_or_the_watchdog():
    gate = Gate()
    for sequence, now, is_new in [(9, 0, True), (1, NS, False), (1, NS + 2, True)]:
        packet = gate.admit(write_packet(DroneState.DEMO, sequence), True, now)
        assert (packet is not None) is is_new
    gate.restart()
    assert gate.admit(write_packet(DroneState.DEMO, 1), True, NS + 3) is not None


def test_ten_thousand_of_a_stranger_are_no_packet():
    gate, chance = Gate(), Random(1)
    good = write_packet(DroneState.DEMO, 2)
    gate.admit(write_packet(DroneState.DEMO, 3), True, 0)
    for number in range(10_000):
        data = chance.choice([chance.randbytes(60), good, good[:30], b"", good + b"\0"])
        assert gate.admit(data, number % 2 == 0, number) is None
    assert gate.refused.total() == 10_000
