"""A test bench: an emulated autopilot on the simulator, and a client that speaks raw MAVLink."""

from __future__ import annotations

import random
from dataclasses import replace

from framing import ACCEPTED, Framing
from pymavlink.dialects.v20 import all as mavlink
from sim_worlds import QUIET, seat

from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS, Imu, Pose, Position
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.firmware import as_built, emulated_firmware, prepared
from kybflow.drivers.emulated_autopilot.session import MavlinkEndpoint
from kybflow.drivers.emulation.body import SimulatedBody
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.protocol.frames import attitude_to_ned, to_ned
from kybflow.drivers.mavlink.transport.router import heartbeat
from kybflow.drivers.mavlink.transport.wire import memory_wires
from kybflow.drivers.sim.world import SimulatedWorld

PERIOD = NS // 125
PLAIN = replace(QUIET, physics=250.0)
PX4_OFFBOARD, PX4_TAKE_OFF, PX4_HOLD, PX4_LAND, PX4_RETURN, PX4_POSITION = (
    profile_of("px4").modes[name]
    for name in ("OFFBOARD", "TAKEOFF", "HOLD", "LAND", "RETURN", "POSITION")
)
GUIDED, LAND, BRAKE, STABILIZE, LOITER = (
    profile_of("ardupilot").modes[name]
    for name in ("GUIDED", "LAND", "BRAKE", "STABILIZE", "LOITER")
)
STATION, ONBOARD = mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER
POSITION_YAW, POSITION, VELOCITY = 0x9F8, 0xDF8, 0xDC7


class Bench:
    """One vehicle. outside: its position comes from the client, which sees it as motion capture
    does; else it has GPS. `say` sends, `heard` is all that came, newest last."""

    def __init__(
        self, name="px4", outside=True, is_prepared=True, context=None, params=PLAIN, seed=1
    ):
        self.firmware = emulated_firmware(name)
        self.px4 = name == "px4"
        place = seat(params=params) if context is None else context
        self.world = SimulatedWorld([place], random.Random(seed))
        self.vehicle = self.world.links[place.context.vehicle]
        kinds = {Imu} | (set() if outside else {Position})
        self.vehicle.subscribe(frozenset(kinds))
        v = self.vehicle
        body = SimulatedBody(v.send, v.controller.attitude, v.grip, v.truth)
        changes = (
            prepared(self.firmware, place.context, 1, outside=outside, station=245)
            if is_prepared
            else as_built(self.firmware, place.context, 1)
        )
        chance = random.Random(seed)
        self.pilot = OnboardAutopilot(
            self.firmware, place.context, body, changes=changes, generator=chance
        )
        self.endpoint = MavlinkEndpoint(self.pilot, chance)
        mine, its = memory_wires()
        self.channel = self.endpoint.connect(its)
        self.wire, self.framing = mine, Framing(245)
        self.now = 0
        self.sees = outside
        self.wanted = None
        self.heard = []
        self.beats = STATION
        self.resets = 0
        self.shift = (0.0, 0.0, 0.0)

    @property
    def truth(self):
        return self.vehicle.truth()

    @property
    def height(self):
        return self.truth.position[2]

    def say(self, message):
        self.wire.send(self.framing.pack(message))

    def command(self, number, *params, tick=True):
        """The acknowledgement of a COMMAND_LONG."""
        before = len(self.heard)
        params = (*params, *[0.0] * (7 - len(params)))
        self.say(mavlink.MAVLink_command_long_message(1, 1, number, 0, *params))
        if not tick:
            return None
        self.run(0.03)
        acks = [m for m in self.heard[before:] if m.get_type() == "COMMAND_ACK"]
        return next(m.result for m in acks if m.command == number)

    def request(self, kind):
        """The message of this kind that it sends on request."""
        number = getattr(mavlink, f"MAVLINK_MSG_ID_{kind}")
        assert self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number) == ACCEPTED
        return self.last(kind)

    def mode(self, number):
        p = (1, number >> 16 & 0xFF, number >> 24) if self.px4 else (1, number)
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, *p)

    def arm(self, code=0):
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, code)

    def disarm(self, code=0):
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, code)

    def run(self, seconds, until=lambda: False):
        """Let time pass; whether `until` came true."""
        for _ in range(round(seconds * NS / PERIOD)):
            if until():
                return True
            self.tick()
        return until()

    def tick(self):
        self.now += PERIOD
        tick = self.now // PERIOD
        self.world.advance(self.now)
        for measured in self.vehicle.read(self.now):
            if isinstance(measured, Pose):
                if self.sees and tick % 4 == 0:
                    self._show(measured)
            else:
                self.pilot.add_measurement(measured, self.now)
        if tick % 125 == 1 and self.beats is not None:
            self.say(heartbeat(self.beats))
        if self.wanted is not None and tick % 5 == 0:
            self.say(self.wanted())
        self.endpoint.step(self.now)
        for data, _ in self.wire.receive(self.now):
            self.heard += self.framing.parse(data)

    def _show(self, pose):
        x, y, z = (a + b for a, b in zip(pose.position, self.shift, strict=True))
        self.say(self.vision((x, y, z), pose.attitude, pose.time))

    def vision(self, position, attitude=LEVEL, time=None, frame=20):
        """ODOMETRY of a pose in ENU, true at `time`."""
        stamp = self.pilot.boot_us(self.now if time is None else time)
        return mavlink.MAVLink_odometry_message(
            stamp, frame, 12, *to_ned(position), attitude_to_ned(attitude), *[0.0] * 6,
            [0.0] * 21, [0.0] * 21, self.resets, 2, 100,
        )  # fmt: skip

    def go(self, x, y, z, yaw=0.0, mask=POSITION_YAW):
        """Ask for a position, ENU and NED's yaw, or with another mask for a velocity."""
        n, e, d = to_ned((x, y, z))
        position, speed = ((n, e, d), (0, 0, 0)) if mask != VELOCITY else ((0, 0, 0), (n, e, d))
        return mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, mask, *position, *speed, 0, 0, 0, yaw, 0
        )

    def last(self, kind):
        return next((m for m in reversed(self.heard) if m.get_type() == kind), None)

    def texts(self):
        return "".join(m.text for m in self.heard if m.get_type() == "STATUSTEXT")

    def set_origin(self):
        self.say(mavlink.MAVLink_set_gps_global_origin_message(1, 473977420, 85455940, 488000, 0))

    def take_off(self, height=1.0):
        """Into the mode that follows setpoints, armed, up; the bench itself."""
        if self.px4:
            self.wanted = lambda: self.go(0.0, 0.0, height)
            self.run(1.5)
            assert self.mode(PX4_OFFBOARD) == ACCEPTED
        else:
            self.set_origin()
            self.run(1.5)
            assert self.mode(GUIDED) == ACCEPTED
        assert self.arm() == ACCEPTED, self.texts()
        if not self.px4:
            assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height) == ACCEPTED
        assert self.run(12.0, lambda: abs(self.height - height) < 0.15), self.height
        self.run(2.0)
        return self
