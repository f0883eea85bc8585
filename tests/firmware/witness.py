"""A second connection to autopilots, as a ground station has beside the mission: it hears, may ask
for what a pilot asks for, and goes on when the mission is dead."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from pymavlink.dialects.v20 import all as mavlink

from kybflow.cli.commands.mavlink.meeting import ticks
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.mavlink.control.requests import CommandRequest, CommandRequests
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.telemetry.received_status import LandedState, ReceivedStatus
from kybflow.drivers.mavlink.telemetry.truth import STREAMS, GroundTruth
from kybflow.drivers.mavlink.transport.router import AUTOPILOT, Router
from kybflow.drivers.mavlink.transport.sockets import open_wire
from kybflow.world.vehicle_context import VehicleContext

OWN = 200
"""Our system id: not that of a mission, whose heartbeat the autopilot waits for."""
RATES = {"EXTENDED_SYS_STATE": 10.0, "HEARTBEAT": 5.0}


def second_address(autopilot: str, system: int) -> str:
    """Where a firmware's own simulator speaks to a ground station."""
    return "udpin:127.0.0.1:14550" if autopilot == "px4" else f"tcp:127.0.0.1:{5752 + 10 * system}"


class Watched:
    """One autopilot. `truth`: of its simulator, once it was given a site. No heartbeat of ours is
    sent, so that nothing takes us for the mission's link."""

    def __init__(self, autopilot: str, system: int, hub: Router) -> None:
        self.profile, self.heard = profile_of(autopilot), ReceivedStatus()
        self.truth: GroundTruth | None = None
        self._port = hub.port(second_address(autopilot, system), system)
        self._requests = CommandRequests(self.heard, target=(system, AUTOPILOT), own_system=OWN)
        self._asked = False
        self.now: Time = 0

    @property
    def rests(self) -> bool:
        """Whether it stands and is disarmed, as it says."""
        return self.heard.landed is LandedState.GROUND and not self.heard.armed

    def behold(self, context: VehicleContext) -> GroundTruth:
        """Hear the truth of its simulator from now on."""
        self.truth = GroundTruth(context, self.profile.sphere)
        self._asked = False
        return self.truth

    def here(self) -> Truth:
        """Where it is, as its simulator knows; to be asked once it was beheld on the ground."""
        assert self.truth is not None
        found = self.truth.truth(self.now)
        assert found is not None
        return found

    def ask(self, command: int, *params: float, now: Time) -> CommandRequest:
        return self._requests.ask(command, *params, now=now)

    def fly_in(self, mode: str, now: Time) -> CommandRequest:
        """What a pilot's switch does."""
        params = self.profile.mode_params(self.profile.modes[mode])
        return self.ask(mavlink.MAV_CMD_DO_SET_MODE, *params, now=now)

    def look(self, now: Time) -> None:
        self.now = now
        for message in self._port.take():
            self.heard.handle(message, now)
            self._requests.handle(message, now)
            if self.truth is not None:
                on_ground = self.heard.landed is LandedState.GROUND
                self.truth.handle(message, now, on_ground=on_ground)
        if self.heard.heartbeat is not None and not self._asked:
            self._asked = True
            rates = RATES if self.truth is None else {**RATES, **STREAMS}
            for name, rate in rates.items():
                if name not in self.profile.streams:
                    continue
                number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
                self.ask(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, round(1e6 / rate), now=now)
        for message in self._requests.due(now):
            self._port.send(message)


class Witness:
    """autopilots: by system id. `of`: each of them."""

    def __init__(self, autopilots: Mapping[int, str]) -> None:
        places = dict.fromkeys(second_address(name, i) for i, name in autopilots.items())
        self._hub = Router({place: open_wire(place) for place in places}, OWN)
        self.of = {i: Watched(name, i, self._hub) for i, name in autopilots.items()}
        self._ticks: Iterator[Time] = ticks()
        self.now: Time = 0

    def look(self, now: Time) -> None:
        self.now = now
        self._hub.poll(now)
        for watched in self.of.values():
            watched.look(now)

    def wait(self, until: Callable[[], bool], seconds: float) -> bool:
        """Look on in real time until it is so, or so long; whether it became so."""
        self.look(next(self._ticks))
        end = self.now + round(seconds * NS)
        while not until() and self.now < end:
            self.look(next(self._ticks))
        return until()

    def close(self) -> None:
        self._hub.close()
