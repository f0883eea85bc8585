"""An emulated drone obeys its client, minds its watchdogs, and refuses what a real one does."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from sim_worlds import QUIET, seat

from kybflow.core.signals import NS
from kybflow.drivers.ardrone import at
from kybflow.drivers.ardrone.at import Ids
from kybflow.drivers.ardrone.navdata import DroneState, Phase, demo, read_packet
from kybflow.drivers.emulated_ardrone.endpoint import Radio
from kybflow.drivers.emulated_ardrone.ports import MemoryPorts
from kybflow.drivers.emulated_ardrone.session import MAX_STEP_NS, open_fleet

PLAIN = replace(QUIET, physics=250.0)


class DroneBench:
    """One drone. `fly`: what is sent every 20 ms from now on. `packets`: all that came."""

    def __init__(self, radio=None, seed=1, params=PLAIN):
        self.fleet = open_fleet([seat(params=params)], [radio or Radio()], random.Random(seed))
        self.endpoint = self.fleet.members[0].onboard
        self.drone, self.ports = self.endpoint.drone, MemoryPorts()
        self.endpoint.connect(self.ports)
        self.now, self.sequence, self.packets = 0, 0, []
        self.lines = None

    def say(self, *lines, sequence=None):
        """Send these at once."""
        for line in lines:
            self.sequence += sequence is None
            self.ports.at.append(line.numbered(self.sequence if sequence is None else sequence))

    def ask(self):
        self.ports.asked.append(b"\1")

    def configured(self):
        """Out of bootstrap, and asked."""
        self.ask()
        self.say(at.config("general:navdata_demo", "FALSE"), at.ctrl(at.RESET_ACKNOWLEDGE))
        self.run(0.1)
        return self

    def fly(self, *lines):
        self.lines = lines

    def run(self, seconds, until=lambda: False):
        """Let time pass; whether `until` came true."""
        for _ in range(round(seconds * NS / MAX_STEP_NS)):
            self.now += MAX_STEP_NS
            if self.lines and self.now % (5 * MAX_STEP_NS) == 0:
                self.say(*self.lines)
            self.fleet.advance(self.now)
            while self.ports.sent:
                self.packets.append(read_packet(self.ports.sent.popleft()))
            if until():
                return True
        return until()

    @property
    def state(self):
        return self.packets[-1].state

    @property
    def demo(self):
        return demo(self.packets[-1].options)

    @property
    def height(self):
        return self.fleet.members[0].vehicle.truth().position[2]

    def is_in(self, *phases):
        return lambda: self.drone.flight.phase in phases

    def hovering(self):
        """In the air."""
        self.fly(at.ref(True), at.pcmd(at.HOVER))
        assert self.run(10.0, self.is_in(Phase.HOVERING)), self.demo
        return self


def test_it_is_in_bootstrap_until_it_is_configured():
    bench = DroneBench()
    bench.run(0.1)
    assert not bench.packets  # nobody has asked
    bench.ask()
    bench.run(0.2)
    assert DroneState.BOOTSTRAP in bench.state
    assert not bench.packets[-1].options
    bench.say(at.config("general:navdata_demo", "TRUE"))
    bench.run(0.2)
    assert DroneState.BOOTSTRAP not in bench.state
    assert DroneState.COMMAND_ACKNOWLEDGED in bench.state
    assert sorted(bench.packets[-1].options) == [0, 16]
    bench.say(at.ctrl(at.RESET_ACKNOWLEDGE))
    bench.run(0.2)
    assert DroneState.COMMAND_ACKNOWLEDGED not in bench.state


@pytest.mark.parametrize(("value", "rate"), [("TRUE", 15), ("FALSE", 200)])
def test_navigation_data_comes_at_its_rate(value, rate):
    bench = DroneBench().configured()
    bench.say(at.config("general:navdata_demo", value))
    bench.run(0.1)
    before = len(bench.packets)
    bench.fly(at.ref(False))
    bench.run(2.0)
    assert len(bench.packets) - before == pytest.approx(2 * rate, abs=2)
    numbers = [packet.sequence for packet in bench.packets]
    assert numbers == sorted(set(numbers))


def test_a_value_of_a_session_needs_its_ids():
    bench = DroneBench().configured()
    bench.say(at.config("custom:session_id", "aaaaaaaa"), at.config("detect:detect_type", "10"))
    bench.run(0.02)
    assert bench.drone.configuration.values["detect:detect_type"] == "3"
    ids = Ids("aaaaaaaa", "00000000", "00000000")
    bench.say(at.config_ids(ids), at.config("detect:detect_type", "10"))
    bench.say(at.config("general:num_version_soft", "9"))
    bench.run(0.02)
    assert bench.drone.configuration.values["detect:detect_type"] == "10"
    assert bench.drone.configuration.values["general:num_version_soft"] == "2.4.8"


def test_it_takes_off_moves_and_lands():
    bench = DroneBench().configured().hovering()
    assert bench.height == pytest.approx(0.8, abs=0.15)
    bench.fly(at.ref(True), at.pcmd(at.Move(right=0.5)))
    bench.run(1.5)
    assert bench.demo.phase is Phase.FLYING
    assert bench.demo.velocity[1] > 300.0  # mm/s, to the right
    assert bench.demo.roll > 2000.0  # millidegrees, right side down
    bench.fly(at.ref(True), at.pcmd(at.Move(up=0.5, clockwise=0.5)))
    bench.run(1.5)
    assert bench.height > 1.0
    assert bench.demo.heading > 20_000.0
    bench.fly(at.ref(True), at.pcmd(at.HOVER))
    bench.run(4.0)
    assert abs(bench.demo.velocity[1]) < 100.0
    bench.fly(at.ref(False))
    assert bench.run(8.0, bench.is_in(Phase.LANDED))
    assert abs(bench.height) < 0.03


def test_it_hovers_after_50_ms_and_lands_after_two_seconds_of_silence():
    bench = DroneBench().configured().hovering()
    bench.fly(at.ref(True), at.pcmd(at.Move(right=0.3)), at.comwdg())
    bench.run(0.5)
    bench.fly()
    silent = bench.now
    assert bench.run(0.2, lambda: DroneState.COMMUNICATION_WATCHDOG in bench.state)
    assert (bench.now - silent) / NS == pytest.approx(0.05, abs=0.025)
    assert bench.drone.flight.moves is None
    assert bench.run(3.0, bench.is_in(Phase.LANDING))
    assert (bench.now - silent) / NS == pytest.approx(2.0, abs=0.03)
    assert DroneState.COMMUNICATION_LOST in bench.state
    told = len(bench.packets)
    assert bench.run(8.0, bench.is_in(Phase.LANDED))
    assert len(bench.packets) == told  # everybody must begin anew


def test_the_watchdogs_bit_stays_until_it_is_answered():
    bench = DroneBench().configured()
    bench.run(0.2)
    assert DroneState.COMMUNICATION_WATCHDOG in bench.state
    bench.fly(at.ref(False))
    bench.run(0.2)
    assert DroneState.COMMUNICATION_WATCHDOG in bench.state
    bench.say(at.comwdg())
    bench.run(0.1)
    assert DroneState.COMMUNICATION_WATCHDOG not in bench.state


def test_what_is_old_or_somebody_elses_is_counted_and_not_obeyed():
    bench = DroneBench().configured().hovering()
    bench.say(at.ref(False), sequence=2)
    bench.drone.receive(at.ref(False).numbered(1), "a stranger", bench.now)
    bench.drone.receive(at.ref(False, emergency=True).numbered(99_999), "a stranger", bench.now)
    bench.run(0.5)
    assert bench.drone.flight.phase is Phase.HOVERING
    assert bench.drone.ignored == {"not newer": 1, "from elsewhere": 2}


def test_fuzz_is_counted_and_nothing_happens():
    bench, chance = DroneBench().configured().hovering(), random.Random(3)
    for number in range(2000):
        text = chance.choice([b"AT*PCMD=", b"AT*REF=", b"AT*CONFIG=", b"AT*CTRL=", b""])
        who = "client" if number % 2 else number
        bench.drone.receive(text + chance.randbytes(chance.randrange(40)) + b"\r", who, bench.now)
    bench.run(0.5)
    assert bench.drone.flight.phase is Phase.HOVERING
    assert bench.drone.ignored.total() >= 1900


@pytest.mark.parametrize(
    "line",
    [
        at.Line("PCMD", (1, 2, 3)), at.Line("PCMD", (1, 1 << 31, 0, 0, 0)), at.Line("REF", ("x",)),
        at.Line("CONFIG", ("a",)), at.Line("CTRL", ()), at.Line("NONSENSE", ()),
        at.Line("PCMD", (1, at.bits_of(float("nan")), 0, 0, 0)),
    ],
)  # fmt: skip
def test_wrong_arguments_are_counted(line):
    bench = DroneBench().configured()
    bench.say(line)
    bench.run(0.02)
    assert bench.drone.ignored.total() == 1


def test_an_emergency_stops_the_rotors_and_is_reset_by_the_same_switch():
    bench = DroneBench().configured()
    bench.fly(at.ref(True))
    bench.run(3.0, lambda: bench.height > 0.1)
    bench.fly(at.ref(False, emergency=True))
    bench.run(0.5)
    assert DroneState.EMERGENCY | DroneState.USER_EMERGENCY in bench.state
    assert bench.run(2.0, lambda: bench.height < 0.05)
    bench.fly(at.ref(True))
    bench.run(1.0)
    assert bench.drone.flight.phase is Phase.LANDED  # not in emergency
    bench.fly(at.ref(False, emergency=True))
    bench.run(0.1)
    assert DroneState.EMERGENCY not in bench.state
    bench.hovering()


def test_with_a_low_battery_it_won_t_take_off_and_lands_with_an_empty_one():
    bench = DroneBench().configured()
    bench.drone.failures.battery = 0.15
    bench.fly(at.ref(True))
    bench.run(1.0)
    assert DroneState.BATTERY_LOW in bench.state
    assert bench.drone.flight.phase is Phase.LANDED
    bench.drone.failures.battery = 0.5
    bench.hovering()
    bench.drone.failures.battery = 0.04
    assert bench.run(0.1, bench.is_in(Phase.LANDING))


def test_a_stopped_rotor_is_an_emergency_that_lasts():
    bench = DroneBench().configured()
    bench.drone.failures.cutout = True
    bench.run(0.1)
    assert DroneState.EMERGENCY | DroneState.CUT_OUT in bench.state
    bench.fly(at.ref(False, emergency=True))
    bench.run(0.1)
    assert DroneState.EMERGENCY in bench.state


def test_a_radio_is_late_loses_and_never_reorders():
    bench = DroneBench(Radio(0.05, 0.02, 0.2))
    bench.ask()
    bench.fly(at.config("general:navdata_demo", "FALSE"))
    bench.run(5.0)
    numbers = [packet.sequence for packet in bench.packets]
    assert numbers == sorted(set(numbers))
    assert len(numbers) / numbers[-1] == pytest.approx(0.8, abs=0.05)


def test_by_the_compass_it_flies_where_the_client_s_axis_points():
    bench = DroneBench().configured().hovering()
    bench.fly(at.ref(True), at.pcmd_mag(at.Move(backward=-0.5), 0.0, 0.03))  # it faces east
    bench.run(1.5)
    assert bench.demo.velocity[1] < -300.0  # to the left, which is north
    assert abs(bench.demo.velocity[0]) < 100.0
    bench.say(at.pcmd_mag(at.Move(), float("nan"), 0.03))
    bench.run(0.02)
    assert bench.drone.ignored == {"wrong arguments": 1}


def test_it_takes_no_moves_while_it_performs_an_animation():
    bench = DroneBench().configured().hovering()
    bench.fly(at.ref(True), at.pcmd(at.Move(backward=-1.0)))
    bench.say(at.config("control:flight_anim", "10,2000"))
    assert bench.run(0.1, bench.is_in(Phase.LOOPING))
    rolls = []
    bench.run(1.9, lambda: rolls.append(bench.demo.roll / 1000.0))
    assert bench.is_in(Phase.LOOPING)()
    assert max(rolls) > 4.0  # degrees
    assert min(rolls) < -4.0
    assert abs(bench.demo.velocity[0]) < 200.0  # mm/s, forward
    assert bench.run(0.2, bench.is_in(Phase.FLYING))


@pytest.mark.parametrize("value", ["20,1000", "-1,1000", "roll", "1"])
def test_an_animation_that_there_is_not_is_counted(value):
    bench = DroneBench().configured()
    bench.say(at.config("control:flight_anim", value))
    bench.run(0.1)
    assert bench.drone.ignored == {"wrong arguments": 1}
