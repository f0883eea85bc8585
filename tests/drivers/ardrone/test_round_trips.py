"""How late a drone does what it is told: by the acknowledge bit, which it is asked to change."""

from __future__ import annotations

import pytest

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import Ids
from kybflow.drivers.ardrone.configuring import RoundTrips
from kybflow.drivers.ardrone.link import round_trip

IDS = Ids("aaaaaaaa", "bbbbbbbb", "cccccccc")
TICK = NS // 100


class Drone:
    """One that obeys what was sent `late` ticks ago, unless it is cut off."""

    def __init__(self, late):
        self.late, self.is_cut, self.acknowledges, self.sent, self._way = late, False, False, [], []
        self.trips = RoundTrips(IDS, self.post)
        self.tick = 0

    def post(self, *lines):
        self.sent.append((self.tick, *lines))
        if not self.is_cut:
            self._way.append((self.tick + self.late, lines[-1].name == "CONFIG"))

    def run(self, ticks):
        """The delay after each tick."""
        delays = []
        for _ in range(ticks):
            self.tick += 1
            while self._way and self._way[0][0] <= self.tick:
                self.acknowledges = self._way.pop(0)[1]
            self.trips.update(self.acknowledges, self.tick * TICK)
            delays.append(self.trips.delay)
        return delays


def test_the_bit_is_asked_to_change_five_times_a_second():
    drone = Drone(late=3)
    drone.run(80)
    assert [lines[-1].name for _, *lines in drone.sent] == ["CONFIG", "CTRL", "CONFIG", "CTRL"]
    first, *lines = drone.sent[0]
    assert [(line.name, line.arguments) for line in lines] == [
        ("CONFIG_IDS", tuple(IDS)),
        ("CONFIG", ("gps:altitude", "0")),
    ]
    assert drone.sent[1][0] - first == 20


def test_the_delay_is_known_after_two_round_trips():
    drone = Drone(late=4)
    assert set(drone.run(20)) == {0.0}
    assert drone.run(100)[4:] == [0.04] * 96


@pytest.mark.parametrize("late", [30, 50, 100])
def test_commands_that_become_late_are_noticed_at_their_second_round_trip(late):
    drone = Drone(late=4)
    drone.run(150)
    drone.late = late
    delays = drone.run(400)
    noticed = next(tick for tick, delay in enumerate(delays) if delay > 0.2)
    assert noticed <= 20 + late + 21
    assert max(delays) == pytest.approx(late / 100, abs=0.02)


def test_one_that_was_cut_off_for_a_second_and_answers_then_is_not_late():
    drone = Drone(late=4)
    drone.run(150)
    drone.is_cut = True
    delays = drone.run(100)
    drone.is_cut = False
    assert max(delays + drone.run(200)) < 0.1


def test_one_that_never_acknowledges_is_not_called_late():
    drone = Drone(late=10**6)
    assert set(drone.run(500)) == {0.0}


def test_it_begins_with_a_bit_that_is_set():
    drone = Drone(late=2)
    drone.acknowledges = True
    drone.run(10)
    assert [lines[0].name for _, *lines in drone.sent] == ["CTRL"]


def test_a_new_flight_knows_none():
    drone = Drone(late=4)
    drone.run(150)
    drone.trips.restart()
    assert drone.trips.delay == 0.0
    assert set(drone.run(20)) == {0.0}


@pytest.mark.parametrize(
    ("late", "ticks", "expected"),
    [
        (4, 10, (False, "no command is acknowledged yet")),
        (4, 100, (True, "a command and its answer take 0.04 s")),
        (30, 100, (False, "a command and its answer take 0.30 s, 0.21 s at most with"
                   " `latency: 0.06 s`")),
        (10**6, 300, (True, "unknown, so that `link_slow` is never raised")),
    ],
)  # fmt: skip
def test_the_preflight_tells_the_round_trip(late, ticks, expected):
    drone = Drone(late)
    drone.run(ticks)
    assert round_trip(drone.trips, 0.06, drone.tick * TICK)[1:3] == expected


def test_one_that_never_acknowledges_is_not_asked_for_ever():
    drone = Drone(late=10**6)
    drone.run(1000)
    assert len(drone.sent) == 67
