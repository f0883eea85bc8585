"""What many autopilots in one process cost, as a share of one core, and how late setpoints leave.

    python bench/mavlink.py [--vehicles 16] [--seconds 10] [--profile 30]

Flies the vehicle `mk` of missions/figure_eight.yaml, sixteen of it, recording on, against emulated
autopilots, first over datagrams of this machine, then over wires in memory. All of it is in one
process and in simulated time, so that a busy machine delays nobody; what the emulator takes, with
its physics, is told apart. Every twentieth of a simulated second pymavlink's own parser reads once
more what came, so that whatever else the machine does slows both. A setpoint is late by how much
longer than its period it left after the one before: by ticks, and by the processor's time of all
that is done earlier in the same tick. What the machine takes for a million additions is told too: a
share is one of a core that is as fast as that.
"""

from __future__ import annotations

import argparse
import cProfile
import dataclasses
import pstats
import random
import socket
import statistics
import tempfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any, ClassVar, NamedTuple

from pymavlink.dialects.v20 import all as dialect

from kybflow.api.flight import RunRequest, fly
from kybflow.drivers.emulated_autopilot import EmulatedAutopilot
from kybflow.drivers.emulated_autopilot.firmware import SetupPlan
from kybflow.drivers.emulated_autopilot.session import open_fleet
from kybflow.drivers.emulation.fleet import Fleet
from kybflow.drivers.mavlink.session import MavlinkSession, open_session
from kybflow.drivers.mavlink.transport import open_wire
from kybflow.drivers.mavlink.transport.address import read_address
from kybflow.drivers.mavlink.transport.sockets import UdpIn
from kybflow.drivers.mavlink.transport.wire import MemoryWire, Received, Wire
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts import Seat, Session
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

MISSION = Path(__file__).parent.parent / "missions" / "figure_eight.yaml"
SENDER = 5
"""Where in a frame the sender's system id is."""
SET_POINT, SYSTEM = dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, 60
"""Its number, and where in its frame the system id is."""
PERIOD, SPACING, GOAL = 20.0, 2.0, 0.5
"""Milliseconds between setpoints; metres between vehicles; the share that is allowed."""
ADDITIONS = 5000
CALLED = (
    "read", "status_texts", "truth", "checks", "subscribe", "send", "arm", "land", "tell_position",
)  # fmt: skip
"""The methods of a link that the engine and simulated sensors call in such a flight."""
SLICE = 5
"""Ticks in a slice."""


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
    the frames that it sent."""

    def __init__(self) -> None:
        self.steps: list[Step] = [Step(None, [], [])]
        self.ground = 0
        self.seats: Sequence[Seat] = ()
        self.came: list[bytes] = []
        self.went: list[bytes] = []
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

    def _receive(self, now: int) -> Received:
        received = super()._receive(now)
        frames = [data for data, _ in received]
        self._traffic.came += frames
        self._traffic.steps.append(Step(now, frames, []))
        return received

    def _send(self, data: bytes, to: Any) -> None:
        super()._send(data, to)
        self._traffic.sent(data)


class Lockstep(Session):
    """The driver for real autopilots on one socket, and the emulator at its other end."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random, traffic: Traffic) -> None:
        plan = SetupPlan("px4", True, True, seats[0].params.own_system, {})
        bare = load_catalog().get("drivers", "emulated_autopilot").params()
        contexts = [Seat(seat.context, bare) for seat in seats]
        self._fleet = open_fleet(contexts, [plan] * len(seats), generator)
        wire = Tapped(traffic)
        self._far: list[Wire] = []
        for member in self._fleet.members:
            self._far.append(open_wire(f"udpout:127.0.0.1:{wire.port}"))
            member.onboard.connect(self._far[-1])
        self._near: MavlinkSession = open_session(seats, lambda _: wire)
        self.links = self._near.links
        traffic.seats = seats
        for name, link in self.links.items():
            for method in CALLED:
                setattr(link, method, noting(traffic, name, method, getattr(link, method)))

    def advance(self, now: int) -> None:
        self._fleet.advance(now)
        self._near.advance(now)

    def close(self) -> None:
        for closes in (self._near, self._fleet, *self._far):
            closes.close()


def noting(traffic: Traffic, name: str, method: str, call: Callable[..., Any]) -> Any:
    """The method, whose calls are noted."""

    def noted(*args: Any) -> Any:
        traffic.steps[-1].calls.append((name, method, args))
        return call(*args)

    return noted


class Datagrams(EmulatedAutopilot):
    traffic: ClassVar[Traffic]

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        return Lockstep(seats, generator, cls.traffic)


class Costs:
    """An observer that adds up what flying takes, in slices of a twentieth of a second, and ends
    the flight after `seconds` in which all were in the air."""

    def __init__(self, traffic: Traffic, seconds: float, profile: bool) -> None:
        self.flown = self.total = self.fleet = 0.0
        self.messages = 0
        self.ratios: list[float] = []
        self.additions: list[float] = []
        self.profile = cProfile.Profile() if profile else None
        """Of what is ours; it makes everything slower."""
        self._traffic, self._seconds = traffic, seconds
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True
        self._last: tuple[float, float, float] | None = None

    def __call__(self, engine: Engine) -> None:
        if not engine.flying or not all(v.activity.off_ground for v in engine.vehicles):
            return
        arrived = process_time()
        if self.profile is not None:
            self.profile.disable()
        traffic, now = self._traffic, engine.seconds()
        if self._last is None:
            traffic.left.clear()
            traffic.ground = len(traffic.steps)
        else:
            self._slice(arrived - self._last[0], traffic.fleet - self._last[1], now - self._last[2])
        traffic.came.clear()
        if self.flown >= self._seconds:
            engine.interrupts = 2  # ends it at once
        elif self.profile is not None:
            self.profile.enable()
        self._last = (process_time(), traffic.fleet, now)

    def _slice(self, total: float, fleet: float, flown: float) -> None:
        began = process_time()
        for frame in self._traffic.came:
            self._parser.parse_buffer(frame)
        parsed = process_time() - began
        began = process_time()
        x = 0
        for number in range(ADDITIONS):
            x += number
        self.additions.append((process_time() - began) * 1e6 / ADDITIONS)
        self.flown, self.total, self.fleet = (
            self.flown + flown, self.total + total, self.fleet + fleet,
        )  # fmt: skip
        self.messages += len(self._traffic.came)
        if self._traffic.came:
            self.ratios.append((total - fleet) / parsed)


class Replay:
    """The same flight's frames and calls once more, given to the driver alone over datagrams.

    `driver`: per slice, the processor time in which the driver receives and parses what came, acts,
    sends, and answers the engine's calls; `parser`: that in which pymavlink's parser reads the same
    frames. Raises SystemExit where the driver does not send what it sent in the flight."""

    def __init__(self, traffic: Traffic) -> None:
        self.driver: list[float] = []
        self.parser: list[float] = []
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
            self.driver.append(took)
            self.parser.append(parsed)
        if self._again.went != self._flight.went[: len(self._again.went)]:
            raise SystemExit("the driver did not send what it sent in the flight")
        for closes in (self._session, *self._far):
            closes.close()

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


def plan_of(count: int, cls: type, address: str | None = "udpin:127.0.0.1:1") -> Plan:
    """`count` vehicles side by side, all on the figure eight."""
    target = "emulated_px4" if cls is EmulatedAutopilot else "px4"
    result = compile_mission(MISSION, catalog=load_catalog(), target=target)
    if result.plan is None:
        raise SystemExit(f"{MISSION} does not compile: {result.diagnostics}")
    first = result.plan.vehicles[0]
    driver = dataclasses.replace(first.driver, cls=cls)
    vehicles = tuple(
        dataclasses.replace(
            first, name=f"v{number}", start=(0.0, SPACING * number, 0.0),
            driver=driver if cls is EmulatedAutopilot else dataclasses.replace(
                driver, params=dataclasses.replace(
                    driver.params, address=address, system=number + 1
                ),
            ),
        )
        for number in range(count)
    )  # fmt: skip
    return dataclasses.replace(
        result.plan, vehicles=vehicles, simulated=True, fence=None, expectations=()
    )


def measure(name: str, count: int, seconds: float, cls: type, lines: int) -> None:
    """Fly, and print one row."""
    traffic = Traffic()
    Datagrams.traffic = traffic
    costs = Costs(traffic, seconds, bool(lines))
    advance, send = Fleet.advance, MemoryWire._send

    def timed(fleet: Fleet, now: int) -> None:
        if costs.profile is not None and costs.flown:
            costs.profile.disable()
        began = process_time()
        advance(fleet, now)
        traffic.tick(now, process_time() - began)
        if costs.profile is not None and costs.flown:
            costs.profile.enable()

    def noted(wire: MemoryWire, data: bytes, to: Any) -> None:
        send(wire, data, to)
        traffic.sent(data)

    Fleet.advance, MemoryWire._send = timed, noted  # type: ignore[method-assign]
    try:
        with tempfile.TemporaryDirectory() as folder:
            request = RunRequest(out=Path(folder) / "run")
            flown = fly(plan_of(count, cls), request, observers=(costs,))
    finally:
        Fleet.advance, MemoryWire._send = advance, send  # type: ignore[method-assign]
    if not costs.flown:
        raise SystemExit(f"it did not fly: {flown.summary['reason']}")
    show(name, count, costs, traffic)
    if traffic.seats:
        show_driver(traffic, costs.flown)
    if costs.profile is not None:
        pstats.Stats(costs.profile).sort_stats("tottime").print_stats(lines)


def show_driver(traffic: Traffic, flown: float) -> None:
    """The driver's part alone."""
    replay = Replay(traffic)
    replay.run()
    ratios = [one / other for one, other in zip(replay.driver, replay.parser, strict=True)]
    driver, parser = sum(replay.driver) / flown, sum(replay.parser) / flown
    print(
        f"  of it the driver alone: {driver:.1%} of a core; pymavlink's parser: {parser:.1%};"
        f" ratio {statistics.median(ratios):.2f}"
    )


def lateness(left: dict[int, list[float]]) -> list[float]:
    """By how much setpoints left later than their period after the one before, ms, sorted."""
    return sorted(
        after - before - PERIOD for times in left.values() for before, after in pairwise(times)
    )


def show(name: str, count: int, costs: Costs, traffic: Traffic) -> None:
    late = lateness(traffic.left)
    flown, ours = costs.flown, costs.total - costs.fleet
    ratio = f"{statistics.median(costs.ratios):6.2f}" if costs.ratios else "     -"
    print(
        f"{name:9s}  {ours / flown:6.1%}  {costs.fleet / flown:6.1%}"
        f"  {1e3 * statistics.median(costs.additions):6.1f}"
        f"  {ratio}  {costs.messages / flown / count:7.0f}  {len(late) / flown / count:6.1f}"
        f"  {late[-1]:6.2f}  {late[int(0.999 * len(late))]:6.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=10.0, help="in the air, simulated")
    parser.add_argument("--profile", type=int, default=0, metavar="LINES")
    o = parser.parse_args()
    print(f"{o.vehicles} vehicles; the goal: {GOAL:.0%} of a core, no setpoint {PERIOD:g} ms late")
    print("wires        ours  emulat.  1e6+ms  x pymav  msg/s/v  sp/s/v  late ms   99.9 %")
    measure("datagrams", o.vehicles, o.seconds, Datagrams, o.profile)
    measure("memory", o.vehicles, o.seconds, EmulatedAutopilot, o.profile)


if __name__ == "__main__":
    main()
