"""A scripted autopilot at the other end of an in-memory wire: it says what a test wants it to say,
and keeps what it was told. It is no model of any firmware."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("pymavlink")

from framing import ACCEPTED, ARM, SERVO, SET_MODE, TAKEOFF, Framing
from pymavlink.dialects.v20 import all as mavlink
from sim_worlds import FRAME

from kybflow.core.geometry import LEVEL, ZERO, Vec3
from kybflow.core.signals import NS, Command, CommandKind, Estimate, Setpoint, SetpointKind
from kybflow.drivers.mavlink.control.arming import FORCE
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.link import AutopilotLink, MavlinkSession, open_session
from kybflow.drivers.mavlink.params import MavlinkParams
from kybflow.drivers.mavlink.telemetry.received_status import ARMED, READY
from kybflow.drivers.mavlink.transport.wire import MemoryWire, Wire, memory_wires
from kybflow.parts import Seat
from kybflow.world.vehicle_context import Parcel, VehicleContext

PERIOD = NS // 50
GROUND, AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
NO_POSITION = 0b111
STREAM = "SET_POSITION_TARGET_LOCAL_NED"
BOTH = pytest.mark.parametrize("name", ["px4", "ardupilot"])


class Fake:
    """`refuses`: by command, the result and the text that it gives. `deaf_to`: commands that it
    does not answer. `obeys`: whether what it accepts is so. `is_heavy`: whether setpoints don't
    lift it. `ill`: the bits of the sensors that it reports as not well. `sent`: all that it was
    sent."""

    def __init__(self, name: str, wire: Wire, system: int = 1) -> None:
        self.profile = profile_of(name)
        self.wire, self.framing = wire, Framing(system, 1)
        self.mode = self.profile.modes["hold"]
        self.armed, self.ready, self.landed, self.flags = False, True, GROUND, 831
        self.innovation = 0.05
        self.position: Vec3 = ZERO
        self.servos = [1900] * 16
        self.params: dict[str, float] = {s.name: 0.0 for s in self.profile.indoors}
        self.refuses: dict[int, tuple[int, str]] = {}
        self.deaf_to: set[int] = set()
        self.obeys, self.is_quiet, self.is_heavy = True, False, False
        self.ill = 0
        self.sent: list[Any] = []
        self._ticks = 0

    def step(self, now: int) -> None:
        for data, _ in self.wire.receive(now):
            for message in self.framing.parse(data):
                self.sent.append(message)
                if message.get_type() == "COMMAND_LONG":
                    self._command(message)
                elif message.get_type() == "PARAM_REQUEST_READ":
                    self._tell_param(message.param_id.split("\0")[0])
                elif message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                    self._rise(self._asked_up(message))
        if not self.is_quiet:
            self.stream(now // 1_000_000)
        self._ticks += 1

    def say(self, text: str, severity: int = 3) -> None:
        self.send(mavlink.MAVLink_statustext_message(severity, text.encode()))

    def took(self, kind: str) -> list[Any]:
        return [message for message in self.sent if message.get_type() == kind]

    def commands(self, number: int) -> list[Any]:
        return [message for message in self.took("COMMAND_LONG") if message.command == number]

    def go(self, mode: str) -> None:
        self.mode = self.profile.modes[mode]
        self.heartbeat()

    def stream(self, ms: int) -> None:
        if self._ticks % 5 == 0:
            self.heartbeat()
            health = READY if self.ready else 0
            self.send(mavlink.MAVLink_extended_sys_state_message(0, self.landed))
            self.send(
                mavlink.MAVLink_sys_status_message(
                    health | self.ill, health | self.ill, health, 0, 16000, 0, 90, 0, 0, 0, 0, 0, 0
                )
            )
            self.send(mavlink.MAVLink_servo_output_raw_message(0, 0, *self.servos))
            if "ESTIMATOR_STATUS" in self.profile.streams:
                spreads = (self.flags, 0.0, self.innovation, *(0.0,) * 4, 0.03, 0.03)
                self.send(mavlink.MAVLink_estimator_status_message(ms * 1000, *spreads))
            else:
                found = (self.flags, 0.05, self.innovation, *(0.05,) * 3)
                self.send(mavlink.MAVLink_ekf_status_report_message(*found))
        x, y, z = self.position
        self.send(mavlink.MAVLink_attitude_quaternion_message(ms, 1.0, *(0.0,) * 6))
        self.send(mavlink.MAVLink_local_position_ned_message(ms, y, x, -z, 0.0, 0.0, 0.0))

    def heartbeat(self) -> None:
        maker = self.profile.mav_autopilot
        base = ARMED if self.armed else 0
        self.send(mavlink.MAVLink_heartbeat_message(2, maker, base, self.mode, 3, 3))

    def _command(self, message: Any) -> None:
        if message.command in self.deaf_to:
            return
        result, text = self.refuses.get(message.command, (ACCEPTED, ""))
        if text:
            self.say(text)
        if message.command == ARM and message.param2 == FORCE:
            result = ACCEPTED
        self.send(mavlink.MAVLink_command_ack_message(message.command, result))
        if result == ACCEPTED and self.obeys:
            self._obey(message)

    def _obey(self, message: Any) -> None:
        if message.command == SET_MODE:
            numbers = self.profile.names
            wanted = (message.param1, message.param2, message.param3)
            self.mode = next(n for n in numbers if self.profile.mode_params(n) == wanted)
        elif message.command == ARM:
            self.armed = message.param1 == 1.0
        elif message.command == TAKEOFF:
            self.landed, self.position = TAKING_OFF, (0.0, 0.0, 0.3)
        elif message.command == SERVO:
            self.servos[round(message.param1) - 1] = round(message.param2)
        self.heartbeat()

    def _asked_up(self, message: Any) -> float:
        """The height that a setpoint asks for: its own, or any above for a push up."""
        if message.type_mask & NO_POSITION == NO_POSITION:
            return self.position[2] + 1.0 if message.afz < 0.0 else self.position[2]
        return float(-message.z)

    def _rise(self, wanted: float) -> None:
        """2 cm towards a setpoint that asks it up; it never sinks, nor goes aside."""
        x, y, z = self.position
        follows = self.armed and self.mode == self.profile.modes["offboard"]
        if follows and wanted > z and not self.is_heavy:
            self.landed, self.position = AIR, (x, y, min(z + 0.02, wanted))

    def _tell_param(self, name: str) -> None:
        if name in self.params:
            value, sort = self.params[name], mavlink.MAV_PARAM_TYPE_REAL32
            self.send(mavlink.MAVLink_param_value_message(name.encode(), value, sort, 1, 0))

    def send(self, message: Any) -> None:
        self.wire.send(self.framing.pack(message))


class Bench:
    """A session with one vehicle, its link, and the fake at the other end."""

    link: AutopilotLink

    def __init__(self, name: str = "px4", payload: Parcel | None = None, **params: Any) -> None:
        ours, theirs = memory_wires()
        self.fake, self.wire = Fake(name, theirs), ours
        self.session = opened(seat(name, payload=payload, **params), {"": ours})
        link = self.session.links["a"]
        assert isinstance(link, AutopilotLink)
        self.link, self.now = link, 0
        self.measured: list[Any] = []

    def run(self, seconds: float, command: Command | None = None) -> None:
        """Let time pass; `command` is sent in every tick."""
        for _ in range(round(seconds * 50)):
            self.tick()
            if command is not None:
                self.link.send(command, self.now)

    def tick(self) -> None:
        self.now += PERIOD
        self.fake.step(self.now)
        self.session.advance(self.now)
        self.measured += self.link.read(self.now)

    def cut(self, seconds: float, command: Command | None = None) -> None:
        """Cut the link for that long."""
        self.wire.deaf = self.wire.mute = True
        self.run(seconds, command)
        self.wire.deaf = self.wire.mute = False

    def arm(self, seconds: float = 20.0, command: Command | None = None) -> bool:
        """Whether it obeys within that time."""
        for _ in range(round(seconds * 50)):
            self.tick()
            if self.link.arm(command or at(ZERO), self.now):
                return True
        return False

    def close(self) -> None:
        """Close the session; what it sends for that is received."""
        self.session.close()
        self.fake.step(self.now + PERIOD)

    def fly(self) -> None:
        """Until it obeys, in the air."""
        self.run(1.0)
        assert self.arm()
        self.fake.landed = AIR
        self.run(0.5, at(ZERO))


def standing(name: str = "px4", **params: Any) -> Bench:
    """A vehicle that was heard for a second, on the ground."""
    bench = Bench(name, **params)
    bench.run(1.0)
    return bench


def flying(name: str = "px4", **params: Any) -> Bench:
    bench = Bench(name, **params)
    bench.fly()
    return bench


def seat(
    name: str = "px4", vehicle: str = "a", payload: Parcel | None = None, **params: Any
) -> Seat:
    context = VehicleContext(vehicle, FRAME, ZERO, 0.0, None, 0.004, payload=payload)
    return Seat(context, MavlinkParams(autopilot=name, **params))


def opened(one: Seat, wires: dict[str, MemoryWire]) -> MavlinkSession:
    """A session over wires that are there already; the first one for any address."""
    return open_session([one], opener=lambda address: next(iter(wires.values())))


def at(position: Vec3) -> Command:
    setpoint = Setpoint(SetpointKind.POSITION, position, ZERO, heading=0.0)
    return Command(LEVEL, 0.0, ZERO, 0.0, True, CommandKind.POSITION, setpoint)


UP = at((0.0, 0.0, 1.0))


def pushed(up: float) -> Command:
    """A command of acceleration, straight up."""
    setpoint = Setpoint(SetpointKind.ACCELERATION, acceleration=(0.0, 0.0, up), heading=0.0)
    return Command(LEVEL, 0.0, ZERO, 0.0, True, CommandKind.ACCELERATION, setpoint)


def estimate(now: int, position: Vec3 = ZERO, source: str = "mocap", age: float = 0.01) -> Estimate:
    return Estimate(now, position, ZERO, LEVEL, ZERO, source, age, 0.001)


RESTING = Command(LEVEL, 0.0, ZERO, None, False)
