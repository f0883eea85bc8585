"""Writing the configuration: one value at a time, each until it is acknowledged, then read back."""

from __future__ import annotations

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import Ids
from kybflow.drivers.ardrone.configuring import Configuring, values_of
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
