"""The MAVLink driver's part of a flight: what it was given is noted, and given to it once more.

`Tapped` and `noting` note each tick's frames and the engine's calls; `Replay` gives them to another
session of the driver, without engine, estimators, recorder and physics, over datagrams. It sends
what it sent in the flight, byte for byte, or the benchmark fails."""

from __future__ import annotations

import gc
import socket
import statistics
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from time import process_time
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as dialect

from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.telemetry import MAKERS
from kybflow.drivers.mavlink.link import MavlinkSession, open_session
from kybflow.drivers.mavlink.protocol.framing import Packer
from kybflow.drivers.mavlink.transport.sockets import UdpIn
from kybflow.drivers.mavlink.transport.wire import Received, read_address
from kybflow.parts import Seat

SENDER = 5
"""Where in a frame the sender's system id is."""
SET_POINT, SYSTEM = dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, 60
"""Its number, and where in its frame the system id is."""
CALLED = (
    "read", "status_texts", "truth", "checks", "subscribe", "send", "arm", "land", "tell_position",
)  # fmt: skip
"""The methods of a link that the engine and simulated sensors call in such a flight."""
SLICE = 5
"""Ticks in a slice."""
FROZEN = {
    "ATTITUDE": 99, "ATTITUDE_QUATERNION": 50, "LOCAL_POSITION_NED": 50, "HIL_STATE_QUATERNION": 50,
    "ODOMETRY": 30, "HIGHRES_IMU": 25, "ALTITUDE": 10, "ATTITUDE_TARGET": 10, "RC_CHANNELS": 10,
    "EXTENDED_SYS_STATE": 10, "SERVO_OUTPUT_RAW": 10, "VFR_HUD": 10, "CURRENT_MODE": 5,
    "ESTIMATOR_STATUS": 5, "HEARTBEAT": 5, "SYS_STATUS": 5, "BATTERY_STATUS": 2, "SYSTEM_TIME": 1,
}  # fmt: skip
"""The telemetry of a vehicle when streams that nobody reads still came, Hz: it stays, so that fewer
messages count as a gain."""


Call = tuple[str, str, tuple[Any, ...]]
"""A vehicle, the method of its link that the engine called, and the arguments."""


class Step(NamedTuple):
    """What the driver was given in one tick: the frames that came, and the engine's calls. now:
    None before the first tick."""

    now: int | None
    frames: list[bytes]
    calls: list[Call]


class Traffic:
    """What is noted while a flight goes on. `came`: frames since the last slice; `left`: when each
    vehicle's setpoints did, in ms; `fleet`: processor time of the emulator; `steps`: what the
    driver was given from the start, the first `ground` of them before all were in the air; `went`:
    the frames that it sent; `frozen`: the frames of `FROZEN` from one vehicle in one second."""

    def __init__(self) -> None:
        self.steps: list[Step] = [Step(None, [], [])]
        self.ground = 0
        self.seats: Sequence[Seat] = ()
        self.came: list[bytes] = []
        self.went: list[bytes] = []
        self.frozen: list[bytes] = []
        self.left: dict[int, list[float]] = defaultdict(list)
        self.fleet = 0.0
        self._now, self._began = 0.0, 0.0

    def tick(self, now: int, fleet: float) -> None:
        """The emulator has done its part of a tick."""
        self.fleet += fleet
        self._now, self._began = now / 1e6, process_time()

    def sent(self, data: bytes) -> None:
        self.went.append(data)
        if data[7] == SET_POINT and not data[8]:
            into = process_time() - self._began
            self.left[data[SYSTEM]].append(self._now + 1e3 * into)


class Tapped(UdpIn):
    def __init__(self, traffic: Traffic) -> None:
        super().__init__(read_address("udpin:127.0.0.1:1")._replace(number=0))
        self._traffic = traffic

    def receive(self, now: int) -> Received:
        received = super().receive(now)
        frames = [data for data, _ in received]
        self._traffic.came += frames
        self._traffic.steps.append(Step(now, frames, []))
        return received

    def send(self, data: bytes, to: Any = None) -> None:
        super().send(data, to)
        self._traffic.sent(data)


def noting(traffic: Traffic, name: str, method: str, call: Callable[..., Any]) -> Any:
    """The method, whose calls are noted."""

    def noted(*args: Any) -> Any:
        traffic.steps[-1].calls.append((name, method, args))
        return call(*args)

    return noted


def frozen_frames(autopilot: OnboardAutopilot) -> list[bytes]:
    """The frames of `FROZEN` in one second."""
    packer = Packer(autopilot.system)
    made = {name: MAKERS[name](autopilot) for name in FROZEN}
    return [packer.pack(made[name], 1) for name, rate in FROZEN.items() for _ in range(rate)]


class Replay:
    """The same flight's frames and calls once more, given to the driver alone over datagrams.

    Processor time per slice: `driver`, in which the driver receives and parses what came, acts,
    sends, and answers the engine's calls; `parser`, in which pymavlink's parser reads the same
    frames; `frozen`, in which it reads the frozen telemetry of the same time. Raises SystemExit
    where the driver does not send what it sent in the flight."""

    def __init__(self, traffic: Traffic) -> None:
        self.driver: list[float] = []
        self.parser: list[float] = []
        self.frozen: list[float] = []
        self._steps, self._ground = traffic.steps, traffic.ground
        self._flight, self._again = traffic, Traffic()
        self._wire = Tapped(self._again)
        self._session: MavlinkSession = open_session(traffic.seats, lambda _: self._wire)
        self._far = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in traffic.seats]
        for far in self._far:
            far.setblocking(False)
            far.connect(("127.0.0.1", self._wire.port))
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True

    def run(self) -> None:
        gc.collect()
        gc.freeze()  # what was noted is no garbage of the driver
        for step in self._steps[: self._ground]:
            self._step(step)
        air = self._steps[self._ground :]
        for at in range(0, len(air) - SLICE, SLICE):
            took = parsed = 0.0
            for step in air[at : at + SLICE]:
                took += self._step(step)
                began = process_time()
                for frame in step.frames:
                    self._parser.parse_buffer(frame)
                parsed += process_time() - began
            began = process_time()
            for frame in self._flight.frozen:
                self._parser.parse_buffer(frame)
            a_second = process_time() - began  # of one vehicle
            self.driver.append(took)
            self.parser.append(parsed)
            self.frozen.append(a_second * len(self._far) * self._seconds(air, at))
        if self._again.went != self._flight.went[: len(self._again.went)]:
            raise SystemExit("the driver did not send what it sent in the flight")
        for closes in (self._session, *self._far):
            closes.close()

    def _seconds(self, air: list[Step], at: int) -> float:
        return ((air[at + SLICE].now or 0) - (air[at].now or 0)) / 1e9

    def _step(self, step: Step) -> float:
        """One tick; what the driver took."""
        for frame in step.frames:
            self._far[frame[SENDER] - 1].send(frame)
        links = self._session.links
        calls = [(getattr(links[name], method), args) for name, method, args in step.calls]
        began = process_time()
        if step.now is not None:
            self._session.advance(step.now)
        for call, args in calls:
            call(*args)
        took = process_time() - began
        for far in self._far:
            with suppress(BlockingIOError):
                while far.recv(1024):
                    pass
        return took


def show_driver(traffic: Traffic, flown: float, ours: float) -> None:
    """The driver's part alone, and what it is measured against. ours: the processor time of the
    whole program but the emulator."""
    replay = Replay(traffic)
    replay.run()
    driver = sum(replay.driver) / flown
    print(f"  the driver alone (receives, parses, acts, sends): {driver:.1%} of a core")
    for words, times in (
        ("the same frames", replay.parser),
        (f"{sum(FROZEN.values())} messages a second, as once", replay.frozen),
    ):
        ratio = statistics.median(a / b for a, b in zip(replay.driver, times, strict=True))
        print(
            f"    {ratio:.2f} x pymavlink's parser on {words} ({sum(times) / flown:.1%});"
            f" the whole program {ours / sum(times):.2f} x"
        )
