"""What a drone is told by REF and PCMD, in its own directions, and what it is refused."""

from __future__ import annotations

from math import pi

import pytest

from kybflow.core.errors import Refused
from kybflow.core.geometry import LEVEL, ZERO, from_euler, from_heading, multiply
from kybflow.core.signals import NS, Command, CommandKind, Setpoint, SetpointKind
from kybflow.drivers.ardrone import at, navdata
from kybflow.drivers.ardrone.flight import FlightControl, move_of
from kybflow.drivers.ardrone.navdata import DroneState, Packet, Phase
from kybflow.drivers.ardrone.params import Limits
from kybflow.drivers.ardrone.telemetry import DroneStatus
from kybflow.drivers.ardrone.wire import CommandStream

RISING = Command(
    LEVEL, 4.1, ZERO, 0.0, True, CommandKind.TILT_CLIMB,
    Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, 0.35)),
)  # fmt: skip


class Drone:
    """A flight control, and a drone that says what it is told to say."""

    def __init__(self):
        self.status, self.stream = DroneStatus(), CommandStream(lambda: 0)
        self.flight = FlightControl(self.status, self.stream, Limits(0.2, 0.7, 1.75), 5.0)

    def says(self, phase, state=DroneState.FLYING):
        demo = navdata.write_demo(navdata.Demo(phase, 80, 0.0, 0.0, 0.0, 0, ZERO))
        self.status.receive(Packet(state, 1, 0, dict([demo])), 0)
        return self

    @property
    def told(self):
        """(flies, emergency, the move if there is one)."""
        commands = [c for data in self.stream.due() for c in at.read_commands(data)]
        bits = commands[0].arguments[0]
        moves = [at.float_of(c.arguments[3]) for c in commands if c.name == "PCMD"]
        return bool(bits & at.FLY), bool(bits & at.EMERGENCY), moves


def test_it_takes_off_follows_and_lands():
    drone = Drone().says(Phase.LANDED, DroneState(0))
    assert drone.told == (False, False, [])
    assert not drone.flight.arm(0)
    assert drone.told == (True, False, [0.0])
    drone.says(Phase.TAKING_OFF)
    assert not drone.flight.arm(NS)
    assert drone.says(Phase.HOVERING).flight.arm(2 * NS)
    drone.flight.send(RISING, 2 * NS)
    assert drone.told == (True, False, [0.5])
    assert not drone.flight.land(3 * NS)
    assert drone.told == (False, False, [])
    assert drone.says(Phase.LANDED, DroneState(0)).flight.land(4 * NS)


def test_a_command_of_another_kind_lands_it():
    drone = Drone().says(Phase.FLYING)
    drone.flight.send(RISING._replace(kind=CommandKind.ATTITUDE_THRUST), 0)
    assert drone.told == (False, False, [])


@pytest.mark.parametrize(
    ("state", "after", "why"),
    [
        (DroneState.EMERGENCY | DroneState.CUT_OUT, 0, "a motor was stopped by force"),
        (DroneState.BATTERY_LOW, 6 * NS, "has not taken off within 5 s: its battery is low"),
        (DroneState(0), 6 * NS, "it is `landed`"),
    ],
)
def test_a_drone_that_won_t_take_off_says_why(state, after, why):
    drone = Drone().says(Phase.LANDED, state)
    if after:
        drone.flight.arm(0)
    with pytest.raises(Refused, match=why):
        drone.flight.arm(after)
    assert drone.told == (False, False, [])


def test_rotors_are_stopped_by_one_switch_that_is_kept_until_it_has_worked():
    drone = Drone().says(Phase.FLYING)
    drone.flight.cut(0)
    for now in (0, NS // 2):
        drone.flight.send(RISING._replace(armed=False), now)
        assert drone.told == (False, True, [])
    drone.flight.send(RISING._replace(armed=False), NS + NS // 10)
    assert drone.told == (False, False, [])  # an answer may be lost: it is switched off and on
    drone.flight.send(RISING._replace(armed=False), 2 * NS)
    assert drone.told == (False, True, [])
    drone.says(Phase.LANDED, DroneState.EMERGENCY)
    drone.flight.send(RISING._replace(armed=False), 2 * NS + 1)
    assert drone.told == (False, False, [])


def test_a_reset_is_not_taken_back_before_it_has_worked():
    drone = Drone().says(Phase.LANDED, DroneState.EMERGENCY)
    for now in range(0, NS, NS // 10):
        drone.flight.reset_emergency(now)
        drone.flight.wait(now)
        assert drone.told == (False, True, [])
    drone.says(Phase.LANDED, DroneState(0)).flight.wait(NS)
    assert drone.told == (False, False, [])


def test_who_lands_by_itself_is_not_followed_and_not_taken_back():
    drone = Drone().says(Phase.FLYING)
    drone.flight.send(RISING, 0)
    drone.says(Phase.LANDING, DroneState.FLYING | DroneState.BATTERY_LOW).flight.watch(0)
    assert drone.flight.override == ("it lands: its battery is low", True, "")
    drone.says(Phase.FLYING).flight.watch(1)
    drone.flight.send(RISING, 1)
    assert drone.told == (False, False, [])


def test_a_drone_that_is_left_to_loop_is_not_lost_until_that_should_be_over():
    drone = Drone().says(Phase.LANDED, DroneState(0))
    with pytest.raises(Refused, match="it doesn't fly"):
        drone.flight.start_act(NS)
    drone.says(Phase.FLYING).flight.send(RISING, 0)
    drone.flight.start_act(3 * NS)
    drone.says(Phase.LOOPING).flight.watch(2 * NS)
    assert drone.flight.override is None
    drone.flight.watch(3 * NS)
    assert drone.flight.override is not None


def test_a_drone_that_loops_by_itself_is_lost():
    drone = Drone().says(Phase.FLYING)
    drone.flight.send(RISING, 0)
    drone.says(Phase.LOOPING).flight.watch(1)
    assert drone.flight.override is not None


LIMITS = Limits(0.2, 0.7, 1.75)


def command(roll=0.0, pitch=0.0, heading=0.0, climb=0.0, turn=0.0):
    setpoint = Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, climb))
    attitude, rates = from_euler(roll, pitch, heading), (0.0, 0.0, turn)
    return Command(attitude, 4.1, rates, heading, True, CommandKind.TILT_CLIMB, setpoint)


@pytest.mark.parametrize("heading", [0.0, pi / 2, -2.5])
def test_signs_are_the_drones(heading):
    move = move_of(command(roll=0.1, pitch=0.05, heading=heading, climb=0.35, turn=0.875), LIMITS)
    assert move.right == pytest.approx(0.5)
    assert move.backward == pytest.approx(-0.25, abs=1e-2)  # nose down goes forward
    assert move.up == pytest.approx(0.5)
    assert move.clockwise == pytest.approx(-0.5)  # to the left is anticlockwise


def test_no_more_than_all_is_asked_for():
    move = move_of(command(roll=-1.0, pitch=1.0, climb=-5.0, turn=-9.0), LIMITS)
    assert move == (-1.0, -1.0, -1.0, 1.0, True)


@pytest.mark.parametrize("heading", [0.0, pi / 2, -2.5])
def test_by_the_compass_the_world_s_axis_is_ahead(heading):
    toward_x = multiply(from_euler(0.0, 0.1, 0.0), from_heading(heading))
    told = command()._replace(attitude=toward_x, heading=heading)
    move = move_of(told, LIMITS, by_compass=True)
    assert (move.right, move.backward) == pytest.approx((0.0, -0.5), abs=1e-6)
