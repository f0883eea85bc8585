"""One simulated vehicle: how it was built, its sensors, its on-board controller and its link."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import hypot
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Protocol

import numpy

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, rotate, scale
from kybflow.core.signals import (
    NS,
    Command,
    Imu,
    Measurement,
    MeasurementKind,
    Payload,
    Position,
    Time,
    Truth,
)
from kybflow.drivers.sim.air import GustyWind, Jet
from kybflow.drivers.sim.lab import as_flown, lab
from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.receiver import Receiver
from kybflow.drivers.sim.sensors import (
    NOTHING,
    Averages,
    ImuSource,
    PoseSampler,
    Positions,
    SimulatedBattery,
    Stamps,
    bias,
    draw,
    draw_blocks,
)
from kybflow.drivers.sim.steps.onboard import AttitudeController
from kybflow.drivers.sim.steps.onboard_state import Numbers, OnboardState
from kybflow.drivers.sim.steps.rotors import constants
from kybflow.parts import ActiveFaults, Link, Override, Seat
from kybflow.parts.link import Touch
from kybflow.world.vehicle_context import LEGS, Airframe

if TYPE_CHECKING:
    import random

OWN_LANDING = Override("its own watchdog lands it", lands=True)
ROTOR_SPREAD = 0.2
"""How much the rotors differ from each other, as a part of `model_error`."""


class Surroundings(Protocol):
    """What a vehicle asks of the world that it is in (`kybflow.drivers.sim.world`). index: the
    vehicle's place there."""

    onboard: OnboardState

    @property
    def now(self) -> Time: ...
    def find_listeners(self) -> None: ...
    def truth(self, index: int) -> Truth: ...
    def index(self, name: str) -> int: ...
    def hurry(self, due: Time) -> None: ...
    def refit(self, index: int) -> None: ...
    def grip(self, index: int, is_open: bool, armed: bool) -> bool: ...


class SimulatedVehicle(Link):
    """A vehicle in a world, and the link to it. `index` is its place there. `is_wired`: who reads
    and commands it sits on board, so that a fault of the link does not come between."""

    faults: ActiveFaults
    is_wired = False

    def __init__(
        self, world: Surroundings, index: int, seat: Seat, generator: random.Random
    ) -> None:
        context, p = seat.context, as_flown(seat.params)
        self.is_calm: bool = p.calm
        streams = numpy.random.default_rng(generator.getrandbits(64)).spawn(7)
        self._world = world
        self._index = index
        body = build(context.airframe, p.model_error, streams[0])
        own = lab(p, context.airframe, body, streams[5])
        self.body = body._replace(drag=body.drag * own.drag)
        self._lab = own
        imu = streams[1]
        offsets = [*bias(imu, p.gyro_bias), *bias(imu, p.accelerometer_bias)]
        noises = [p.gyro_noise] * 3 + [p.accelerometer_noise] * 3
        self.imu_source = ImuSource(draw_blocks(imu, offsets, noises), own.vibration)
        self.imu_bias = NOTHING
        self._dt = 1.0 / p.physics
        self.controller = AttitudeController(
            context.airframe, own.loop, context.heading, self._dt, world.onboard, index
        )
        world.onboard.constants[index] = constants(
            context.airframe, self.body, own.inflow, self._dt
        )
        stamps = Stamps(own.stamps, p.stamp_jitter, p.mocap_loss, streams[6])
        self.capture = PoseSampler(
            p.mocap_rate, p.mocap_latency, p.mocap_position_noise, p.mocap_attitude_noise,
            own.markers, stamps, streams[2],
        )  # fmt: skip
        spread = (p.position_noise, p.position_noise, p.position_noise_up)
        self._positions = Positions(p.position_rate, p.position_latency, spread, streams[4])
        self.battery = SimulatedBattery(context.airframe, p.battery, p.battery_rate)
        self.wind = GustyWind(p.wind, p.gust, draw(streams[3], [0.0] * 3, [1.0] * 3))
        self.due: Time = 0
        self.faults = ActiveFaults(context.vehicle, self._rigged)
        self._arriving: deque[tuple[Time, Measurement]] = deque()
        self._filters = self.faults.filters
        self._push = ZERO
        self._deaf = self._mute = False
        self._seen_as = self._sees_as = index
        self._imu = Averages()
        self._subscribed = False
        self._receiver = Receiver(self.controller, context.airframe, p.watchdog)
        self._minded: Time = 0
        self.tell_touch: Callable[[Touch], None] = _untold
        if context.payload is not None:
            self._arriving.append(
                (0, Payload(0, not context.payload.aboard, context.payload.aboard))
            )

    def measure(self, now: Time) -> None:
        """Take every measurement that is due at `now`, and every command; mind the watchdog."""
        capture, battery = self.capture, self.battery
        if capture.schedule.due <= now:
            truth = self._world.truth(self._seen_as)
            while (at := capture.schedule.due) <= now:
                pose = capture.measure(truth, at, now)
                if pose is not None:
                    self._arriving.append((at + capture.latency, pose))
                capture.schedule.move_on()
        if battery.schedule.due <= now:
            self._arriving.append((now, battery.measure(now)))
            self._load(now)
            battery.schedule.move_on()
        if self._minded <= now:
            falling, self._minded = self._receiver.descent, self._receiver.mind(now)
            if self._receiver.descent is not falling:
                self._world.find_listeners()
            if not self._deaf:
                self.override = OWN_LANDING if self.falls else None
        self.due = min(capture.schedule.due, battery.schedule.due, self._minded)
        if self._positions.is_wanted:
            if self._positions.schedule.due <= now:
                self._positions.measure(self.truth(), now)
            self.due = min(self.due, self._positions.schedule.due)

    @property
    def is_blown(self) -> bool:
        """Whether it feels wind, is pushed, or vibrates."""
        return self.wind.blows or self.faults.blows or self._push != ZERO or self._lab.stirs

    @property
    def thrust(self) -> float:
        """What its rotors give, N."""
        onboard, index = self._world.onboard, self._index
        return _given(onboard.rotors[index], onboard.thrusts[index])

    def jet(self) -> Jet | None:
        """The air that it blows down; None where that acts on nobody."""
        downwash = self._lab.downwash
        return None if downwash is None else downwash.jet(self.truth().position, self.thrust)

    def blown(self, now: Time, elapsed: float, jets: Sequence[Jet]) -> Vec3:
        """The wind at it, m/s, world frame, `elapsed` seconds after the last call: its own, and
        those of all vehicles' jets, whose momenta add up."""
        x, y, z = add(self.wind.after(elapsed), self.faults.wind(now))
        if jets:
            place = self.truth().position
            z -= hypot(*(jet.sinks(place) for jet in jets))
        return x, y, z

    def pushed(self, elapsed: float, thrust: float) -> Numbers:
        """What pushes it beside `thrust` and the wind, N, world frame, and turns it, N m, body
        frame, `elapsed` seconds after the last call."""
        eddies, ground, force = self._lab.eddies, self._lab.ground, self._push
        x, y, z, *turned = NOTHING if eddies is None else eddies.after(elapsed)
        if ground is not None:
            truth = self.truth()
            lift = thrust * ground.gain(truth.position[2] + LEGS)
            force = add(force, rotate(truth.attitude, (0.0, 0.0, lift)))
        fx, fy, fz = force
        return (x + fx, y + fy, z + fz, *turned)

    def vibration(self, thrust: float) -> float:
        """How much it vibrates, over what it does in hover: as a rotor's imbalance, by the square
        of its speed and so by its thrust."""
        return thrust / (self.body.mass * GRAVITY)

    def _load(self, now: Time) -> None:
        """Drain the battery by what the rotors give, and let their thrust sag with it."""
        onboard, index, battery = self._world.onboard, self._index, self.battery
        given = _given(onboard.rotors[index], self._thrusts())
        battery.charge.drain(given, 1.0 / battery.schedule.rate if now else 0.0)
        onboard.thrusts[index] = self._thrusts()

    def _thrusts(self) -> Numbers:
        """The largest thrust of each rotor, on the battery as it is."""
        sag, weak = self.battery.charge.level**2, self.faults.rotors
        return tuple(sag * f * left for f, left in zip(self.body.thrust, weak, strict=True))

    @property
    def listens(self) -> bool:
        """Whether it wants what its IMU measures in each step."""
        return self._subscribed or self.falls

    @property
    def falls(self) -> bool:
        """Whether its watchdog brings it down, step by step."""
        return self._receiver.descent is not None

    def add_imu(self, felt: Numbers) -> None:
        """Take what its IMU measured in a step."""
        self._imu.add(felt)
        self._receiver.come_down(felt[-1], self._dt)

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        if Imu in kinds and not self._subscribed:
            self._subscribed = True
            self._imu.measure(self._world.now, self._dt)  # what was felt before is nobody's
            self._world.find_listeners()
        if Position in kinds and not self._positions.is_wanted:
            self._positions.begin(self._world.now)
            self.due = min(self.due, self._positions.schedule.due)
            self._world.hurry(self.due)

    def read(self, now: Time) -> Sequence[Measurement]:
        arriving, positions = self._arriving, self._positions.is_wanted
        if not (self._subscribed or positions) and (not arriving or arriving[0][0] > now):
            return ()
        arrived = []
        while arriving and arriving[0][0] <= now:
            arrived.append(arriving.popleft()[1])
        imu = self._imu.measure(self._world.now, self._dt) if self._subscribed else None
        if imu is not None:
            arrived.append(imu)
        if positions and (late := self._positions.arrived(now)):
            arrived = sorted([*late, *arrived], key=attrgetter("time"))
        if self._deaf:
            return ()
        return self._filtered(arrived) if self._filters else arrived

    def _filtered(self, arrived: list[Measurement]) -> list[Measurement]:
        left = []
        for arriving in arrived:
            measurement: Measurement | None = arriving
            for change in self._filters:
                measurement = None if measurement is None else change(measurement)
            if measurement is not None:
                left.append(measurement)
        return left

    def send(self, command: Command, now: Time) -> None:
        receiver = self._receiver
        if self._mute:
            return
        commands = self._lab.late
        late = 0 if commands is None else round(max(0.0, next(commands)[0]) * NS)
        if not (receiver.late or late):
            receiver.hear(command, now)
            return
        self._minded = min(self._minded, receiver.delay(command, now, late))
        self.due = min(self.due, self._minded)
        self._world.hurry(self.due)

    def cut(self, now: Time) -> None:
        if not self._mute:
            self._receiver.stop()
            self._world.find_listeners()

    def grip(self, is_open: bool, now: Time) -> None:
        if self._mute:
            return
        aboard = self._world.grip(self._index, is_open, self.controller.armed)
        self._arriving.append((now, Payload(now, is_open, aboard)))

    def _rigged(self) -> None:
        """Obey the rig."""
        rig = self.faults
        self._filters = rig.filters
        self._push = scale(rig.push, self.body.mass)
        self._deaf, self._mute = (not self.is_wired and cut for cut in (rig.deaf, rig.mute))
        self._receiver.put_off(0 if self.is_wired else round(rig.late * NS))
        self._seen_as = self._world.index(rig.body)
        self._sees_as = self._world.index(rig.view)
        self.battery.charge.sag = rig.sag
        self.imu_bias = (*rig.gyro_bias, *rig.accelerometer_bias)
        self._world.refit(self._index)

    def truth(self) -> Truth:
        return self._world.truth(self._index)

    def view(self) -> Truth:
        return self._world.truth(self._sees_as)

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        self.tell_touch = tell


def _given(rotors: Numbers, most: Numbers) -> float:
    """What rotors give together, by their states and their largest thrusts, N."""
    (a, b, c, d), (fa, fb, fc, fd) = rotors, most
    return a * fa + b * fb + c * fc + d * fd


def _untold(touch: Touch) -> None:
    """Nobody wants to know."""


def jets_of(vehicles: Sequence[SimulatedVehicle]) -> list[Jet]:
    """The air that vehicles blow down on each other; one alone blows on nobody."""
    if len(vehicles) < 2:
        return []
    return [jet for vehicle in vehicles if (jet := vehicle.jet()) is not None]


def build(airframe: Airframe, error: float, generator: Any) -> BuiltAirframe:
    """A vehicle within `error` of what its maker says, each rotor a little different. What is drawn
    is how the mass spreads along each axis, since three moments of inertia drawn apart from each
    other may be those of no body."""
    draws = (1.0 + error * generator.uniform(-1.0, 1.0, 7)).tolist()
    mass, along_x, along_y, along_z, thrust, rotor_time, drag = draws
    half = sum(airframe.inertia) / 2.0
    xx, yy, zz = (
        max(0.0, half - moment) * factor
        for moment, factor in zip(airframe.inertia, (along_x, along_y, along_z), strict=True)
    )
    spread = 1.0 + error * ROTOR_SPREAD * generator.uniform(-1.0, 1.0, 4)
    a, b, c, d = (airframe.thrust * thrust * spread).tolist()
    return BuiltAirframe(
        airframe.mass * mass, (yy + zz, zz + xx, xx + yy), (a, b, c, d),
        airframe.rotor_time * rotor_time, airframe.drag * drag,
    )  # fmt: skip
