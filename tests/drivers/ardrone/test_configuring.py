"""Values are written one at a time until acknowledged and read back; then delays are measured."""

from __future__ import annotations

import pytest

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import Ids
from kybflow.drivers.ardrone.configuring import Configuring, RoundTrips, values_of
from kybflow.drivers.ardrone.link import round_trip
from kybflow.drivers.ardrone.params import ArdroneParams, Limits

IDS = Ids("aaaaaaaa", "bbbbbbbb", "cccccccc")
MS = NS // 1000


class Drone:
    """What is sent, and a drone that acknowledges all or nothing."""

    def __init__(self, answers=True):
        self.sent, self.acknowledges, self.answers, self.listened = [], False, answers, 0
        values = values_of(ArdroneParams(), Limits(0.2, 0.7, 1.75), IDS)
        self.configuring = Configuring(values, IDS, self.post, self.listen)

    def post(self, *lines):
        self.sent.append([(line.name, line.arguments) for line in lines])
        for line in lines:
            if self.answers and line.name == "CONFIG":
                self.acknowledges = True
            if self.answers and line.name == "CTRL" and line.arguments[0] == 5:
                self.acknowledges = False

    def listen(self):
        self.listened += 1

    def run(self, seconds, begin=0.0):
        for at in range(round(begin * 100), round((begin + seconds) * 100)):
            self.configuring.update(self.acknowledges, at * 10 * MS)


def test_each_value_is_written_with_the_ids_before_it_and_read_back():
    drone = Drone()
    drone.run(5.0)
    written = [lines for lines in drone.sent if lines[-1][0] == "CONFIG"]
    keys = [lines[-1][1][0] for lines in written]
    assert keys[:4] == [
        "general:navdata_demo", "custom:session_id", "custom:application_id", "custom:profile_id",
    ]  # fmt: skip
    assert [len(lines) for lines in written] == [1] + [2] * (len(keys) - 1)
    assert written[1][0] == ("CONFIG_IDS", tuple(IDS))
    values = {key: value for lines in written for key, value in [lines[-1][1]]}
    assert values["control:euler_angle_max"] == "0.200000"
    assert values["control:altitude_max"] == "3000"
    assert drone.configuring.pending == "the drone has not sent its configuration"
    assert drone.listened
    drone.configuring.read("\n".join(f"{k} = {v}" for k, v in values.items()).encode())
    assert (drone.configuring.pending, drone.configuring.mismatches) == ("", [])


def test_what_is_not_acknowledged_is_sent_again():
    drone = Drone(answers=False)
    drone.run(1.0)
    assert [lines[-1][1] for lines in drone.sent] == [("general:navdata_demo", "FALSE")] * 4
    assert drone.configuring.pending == "`general:navdata_demo` is not acknowledged"
    drone.answers = True
    drone.run(5.0, 1.0)
    assert "configuration" in drone.configuring.pending


def test_a_bit_that_is_set_at_first_is_cleared_first():
    drone = Drone()
    drone.acknowledges = True
    drone.run(0.05)
    assert [lines[-1][0] for lines in drone.sent[:2]] == ["CTRL", "CONFIG"]


def test_a_value_that_the_drone_does_not_take_is_told():
    drone = Drone()
    drone.run(5.0)
    drone.configuring.read(b"control:altitude_max = 5000\n")
    assert drone.configuring.mismatches == ["`control:altitude_max` is 5000, not 3000"]


def test_a_drone_that_starts_again_is_written_again():
    drone = Drone()
    drone.run(5.0)
    drone.configuring.restart()
    assert drone.configuring.pending == "`general:navdata_demo` is not acknowledged"


TICK = NS // 100


class LateDrone:
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
    drone = LateDrone(late=3)
    drone.run(80)
    assert [lines[-1].name for _, *lines in drone.sent] == ["CONFIG", "CTRL", "CONFIG", "CTRL"]
    first, *lines = drone.sent[0]
    assert [(line.name, line.arguments) for line in lines] == [
        ("CONFIG_IDS", tuple(IDS)),
        ("CONFIG", ("gps:altitude", "0")),
    ]
    assert drone.sent[1][0] - first == 20


def test_the_delay_is_known_after_two_round_trips():
    drone = LateDrone(late=4)
    assert set(drone.run(20)) == {0.0}
    assert drone.run(100)[4:] == [0.04] * 96


@pytest.mark.parametrize("late", [30, 50, 100])
def test_commands_that_become_late_are_noticed_at_their_second_round_trip(late):
    drone = LateDrone(late=4)
    drone.run(150)
    drone.late = late
    delays = drone.run(400)
    noticed = next(tick for tick, delay in enumerate(delays) if delay > 0.2)
    assert noticed <= 20 + late + 21
    assert max(delays) == pytest.approx(late / 100, abs=0.02)


def test_one_that_was_cut_off_for_a_second_and_answers_then_is_not_late():
    drone = LateDrone(late=4)
    drone.run(150)
    drone.is_cut = True
    delays = drone.run(100)
    drone.is_cut = False
    assert max(delays + drone.run(200)) < 0.2  # the default bound


def test_commands_that_are_queued_for_seconds_are_noticed_before_the_first_answer():
    drone = LateDrone(late=4)
    drone.run(150)
    drone.late = 200
    delays = drone.run(150)
    assert next(tick for tick, delay in enumerate(delays) if delay > 0.2) < 150


def test_one_that_never_acknowledges_is_not_called_late():
    drone = LateDrone(late=10**6)
    assert set(drone.run(500)) == {0.0}


def test_it_begins_with_a_bit_that_is_set():
    drone = LateDrone(late=2)
    drone.acknowledges = True
    drone.run(10)
    assert [lines[0].name for _, *lines in drone.sent] == ["CTRL"]


def test_a_new_flight_knows_none():
    drone = LateDrone(late=4)
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
    drone = LateDrone(late)
    drone.run(ticks)
    assert round_trip(drone.trips, 0.06, drone.tick * TICK)[1:3] == expected


def test_one_that_never_acknowledges_is_not_asked_for_ever():
    drone = LateDrone(late=10**6)
    drone.run(1000)
    assert len(drone.sent) == 67
