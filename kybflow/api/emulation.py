"""Serves emulated devices to any client in real time: autopilots and AR.Drones on simulated
vehicles, and a motion-capture system that tracks bodies at rest."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from kybflow.api.opening import context_of
from kybflow.core.geometry import Vec3
from kybflow.core.signals import Time
from kybflow.drivers import firmware_names
from kybflow.drivers.emulation.breaking import Break
from kybflow.drivers.emulation.fleet import Fleet
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts import Seat
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.clock import SimulatedClock, WallClock

if TYPE_CHECKING:
    from kybflow.drivers.emulated_ardrone.endpoint import DroneEndpoint, Radio
    from kybflow.drivers.emulated_autopilot.firmware import SetupPlan
    from kybflow.drivers.emulated_autopilot.session import MavlinkEndpoint
    from kybflow.sensors.vrpn.server import Server

RATE, STILL_RATE = 250, 120
SPACING = 2.0
"""Distance between the vehicles if no mission is given, metres."""
MISSION = """kybflow: 1
mission: emulated
import: {std: kybflow/airframes}
vehicles:
"""
VEHICLE = """  v{number}:
    like: std.{airframe}
    start: {{at: [0, {y}, 0]}}
    behaviors:
      up: {{do: take_off, height: 1 m, then: down}}
      down: {{do: land}}
"""


def plan_of(airframe: str, count: int) -> Plan | None:
    """Return the plan of `count` vehicles side by side, or None if the standard library has no such
    airframe."""
    vehicles = (
        VEHICLE.format(number=n + 1, airframe=airframe, y=SPACING * n) for n in range(count)
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "emulated.yaml"
        path.write_text(MISSION + "".join(vehicles), encoding="utf-8")
        return compile_mission(path, catalog=load_catalog()).plan


def seats_of(plan: Plan, driver: str) -> list[Seat]:
    """Return a seat for each vehicle of the plan, with the driver's default parameters."""
    params = load_catalog().get("drivers", driver).params()
    return [Seat(context_of(plan, vehicle), params) for vehicle in plan.vehicles]


class Wires(NamedTuple):
    """The links of emulated autopilots.

    addresses: the addresses of the first autopilot; if empty, those that the firmware's own
    simulator uses. system: the system id of the first autopilot. secret: the key that signs
    messages.
    """

    addresses: Sequence[str] = ()
    system: int = 1
    secret: bytes | None = None


@contextmanager
def autopilots(
    seats: Sequence[Seat],
    setup: SetupPlan,
    wires: Wires,
    seed: int,
    started: Callable[[str, int, list[str]], None],
) -> Iterator[Fleet[MavlinkEndpoint]]:
    """Start autopilots that run one firmware. started: called with the name, system id and
    addresses of each. Raises DriverError."""
    from kybflow.drivers.emulated_autopilot.firmware import check_names, emulated_firmware
    from kybflow.drivers.emulated_autopilot.session import open_fleet
    from kybflow.drivers.mavlink.transport.sockets import open_wire

    own = (_own_address(setup.firmware), *emulated_firmware(setup.firmware).stations)
    check_names(setup.firmware, setup.changes)
    with ExitStack() as stack:
        fleet = open_fleet(seats, [setup] * len(seats), random.Random(seed), wires.system)
        stack.callback(fleet.close)
        for number, (seat, member) in enumerate(zip(seats, fleet.members, strict=True)):
            addresses = []
            for address in wires.addresses or own:
                wire = stack.enter_context(closing(open_wire(_shifted(address, number))))
                is_station = address in own[1:]
                member.onboard.connect(wire, wires.secret, is_station=is_station)
                addresses.append(wire.address)
            started(seat.context.vehicle, wires.system + number, addresses)
        yield fleet


def _own_address(firmware: str, number: int = 0) -> str:
    """Return the address at which the firmware's own simulator serves its driver. number: the
    vehicle's number, from 0."""
    from kybflow.drivers.mavlink.firmware import profile_of
    from kybflow.drivers.mavlink.transport.wire import read_address

    theirs = read_address(profile_of(firmware).default_address(1 + number))
    return str(theirs._replace(kind={"udpin": "udpout", "tcp": "tcpin"}[theirs.kind]))


def _shifted(place: str, number: int) -> str:
    """Return a vehicle's address, given the address of the first vehicle. For an address of the
    firmware's simulator it is the simulator's next port; for an address that listens, a port 10
    higher per vehicle; any other address is a ground station, which all vehicles share."""
    from kybflow.drivers.mavlink.transport.wire import LISTENING, read_address

    for firmware in firmware_names("emulated_autopilot"):
        if place == _own_address(firmware):
            return _own_address(firmware, number)
    address = read_address(place)
    step = 10 if address.kind in LISTENING else 0
    return str(address._replace(number=address.number + step * number))


@contextmanager
def drones(
    seats: Sequence[Seat],
    radio: Radio,
    host: str,
    seed: int,
    started: Callable[[str, str], None],
    *,
    video: bool = False,
) -> Iterator[Fleet[DroneEndpoint]]:
    """Start AR.Drones, the first at the loopback address `host`, the others at the addresses after
    it. video: whether they send camera images. started: called with the name and address of each.
    Raises DriverError."""
    from kybflow.drivers.ardrone.configuring import NAME
    from kybflow.drivers.emulated_ardrone.ports import SocketPorts, host_of
    from kybflow.drivers.emulated_ardrone.session import open_fleet
    from kybflow.drivers.emulated_ardrone.video import DroneVideo

    hosts = [host_of(number, host) for number in range(len(seats))]
    with ExitStack() as stack:
        fleet = open_fleet(seats, [radio] * len(seats), random.Random(seed))
        stack.callback(fleet.close)
        for seat, where, member in zip(seats, hosts, fleet.members, strict=True):
            endpoint, truth = member.onboard, member.vehicle.truth
            endpoint.connect(stack.enter_context(closing(SocketPorts(where))))
            name = f"{seat.context.vehicle}, emulated by process {os.getpid()}"
            endpoint.drone.configuration.values[NAME] = name
            if video:
                configuration = endpoint.drone.configuration
                endpoint.video = DroneVideo(seat.context, truth, configuration, seed)
            started(seat.context.vehicle, where)
        yield fleet


def serve(
    fleet: Fleet[Any], breaks: Sequence[Break], speed: float, began: Callable[[Break, Time], None]
) -> None:
    """Run the fleet until a KeyboardInterrupt. speed: factor of real time. began: called with each
    failure when it begins, and the time."""
    clock = SimulatedClock(RATE, speed)
    fleet.serve(iter(clock.step, None), breaks, began)


def publish_at_rest(places: dict[str, Vec3], server: Server, seed: int) -> NoReturn:
    """Publish the poses of bodies at rest until a KeyboardInterrupt, with the default noise of the
    simulator's motion capture. Raises CodecError if VRPN can't send a name."""
    from kybflow.sensors.vrpn.server import PoseNoise, still, to

    sim = load_catalog().get("drivers", "sim").params()
    noise = PoseNoise(sim.mocap_position_noise, sim.mocap_attitude_noise)
    publish, clock = still(places, to(server), noise, random.Random(seed)), WallClock(STILL_RATE)
    while True:
        publish(clock.step())
