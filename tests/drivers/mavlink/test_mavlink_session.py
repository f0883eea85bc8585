"""Opening and closing: who shares a wire, who is who."""

from __future__ import annotations

import pytest
from scripted_autopilot import PERIOD, Fake, seat

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.link import open_session
from kybflow.drivers.mavlink.transport.wire import MemoryWire, memory_wires


class Closing:
    """Opens in-memory wires, and keeps both ends by address."""

    def __init__(self):
        self.ends: dict[str, tuple[MemoryWire, MemoryWire]] = {}
        self.closed: list[str] = []

    def __call__(self, address):
        ours, _ = self.ends[address] = memory_wires(address)
        ours.close = lambda: self.closed.append(address)
        return ours


def advance(session, fakes, seconds, now=0):
    for _ in range(round(seconds * 50)):
        now += PERIOD
        for fake in fakes:
            fake.step(now)
        session.advance(now)
    return now


def test_a_vehicle_is_where_its_simulator_is_and_its_place_is_its_id():
    opener = Closing()
    open_session([seat("px4", "a"), seat("ardupilot", "b"), seat("px4", "c")], opener)
    assert list(opener.ends) == [
        "udpin:127.0.0.1:14540",
        "tcp:127.0.0.1:5770",
        "udpin:127.0.0.1:14542",
    ]


def test_two_autopilots_of_both_kinds_are_flown_by_one_process():
    opener = Closing()
    session = open_session([seat("px4", "a"), seat("ardupilot", "b")], opener)
    (_, one), (_, other) = opener.ends.values()
    fakes = [Fake("px4", one, 1), Fake("ardupilot", other, 2)]
    advance(session, fakes, 1.0)
    assert [link.armed for link in session.links.values()] == [False, False]
    fakes[1].armed = True
    advance(session, fakes, 1.0)
    assert [link.armed for link in session.links.values()] == [False, True]


def test_two_share_a_wire_by_their_ids():
    opener = Closing()
    session = open_session(
        [seat("px4", "a", address="udpin:h:1"), seat("px4", "b", address="udpin:h:1")], opener
    )
    assert list(opener.ends) == ["udpin:h:1"]
    assert list(session.links) == ["a", "b"]


def test_two_with_one_id_at_one_address_are_refused_and_nothing_stays_open():
    opener = Closing()
    seats = [seat("px4", n, address="udpin:h:1", system=7) for n in "ab"]
    with pytest.raises(DriverError, match="two vehicles are system 7"):
        open_session(seats, opener)
    assert opener.closed == ["udpin:h:1"]


def test_two_of_us_at_one_address_are_refused():
    seats = [
        seat("px4", "a", address="udpin:h:1"),
        seat("px4", "b", address="udpin:h:1", own_system=9),
    ]
    with pytest.raises(DriverError, match="own_system"):
        open_session(seats, Closing())


def test_a_wire_that_won_t_open_closes_the_others():
    opener = Closing()

    def opened(address):
        if address == "tcp:h:2":
            raise DriverError("nobody is there")
        return opener(address)

    seats = [seat("px4", "a", address="udpin:h:1"), seat("px4", "b", address="tcp:h:2")]
    with pytest.raises(DriverError, match="nobody is there"):
        open_session(seats, opened)
    assert opener.closed == ["udpin:h:1"]


def test_closing_closes_every_wire_once():
    opener = Closing()
    session = open_session([seat("px4", "a"), seat("px4", "b")], opener)
    session.close()
    assert len(opener.closed) == 2
