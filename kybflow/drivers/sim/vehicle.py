"""One simulated vehicle: its link, sensors, on-board controller and disturbances."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import hypot
from operator import attrgetter
from typing import TYPE_CHECKING, Protocol

import numpy

from kybflow.core.errors import DriverError
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
from kybflow.drivers.sim.hand import CarryingHand
from kybflow.drivers.sim.lab import GustyWind, Jet, as_flown, build, lab
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
from kybflow.drivers.sim.steps.onboard import AttitudeController, Numbers, OnboardState
from kybflow.drivers.sim.steps.rotors import constants
from kybflow.parts import ActiveFaults, Link, Override, Seat
from kybflow.parts.link import Touch
from kybflow.world.vehicle_context import LEGS

if TYPE_CHECKING:
    import random

TOUCH_GAP: Time = NS // 2
"""Time without contact after which the next contact counts as a new touch."""
OWN_LANDING = Override("its own watchdog lands it", lands=True)


class Surroundings(Protocol):
    """The methods of the world that a vehicle uses (`kybflow.drivers.sim.world`). index: the
    vehicle's index in the world."""

    onboard: OnboardState

    @property
    def now(self) -> Time: ...
    def update_imu_readers(self) -> None: ...
    def truth(self, index: int) -> Truth: ...
    def index(self, name: str) -> int: ...
    def schedule(self, due: Time) -> None: ...
    def apply_faults(self, index: int) -> None: ...
    def grip(self, index: int, is_open: bool, armed: bool) -> bool: ...


class SimulatedVehicle(Link):
    """A vehicle and the link to it. index: the vehicle's index in the world. is_wired: whether the
    computer that flies it is on board (an emulated autopilot), so that faults of the link don't
    apply."""

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
        self.faults = ActiveFaults(context.vehicle, self._apply_faults)
        self._arriving: deque[tuple[Time, Measurement]] = deque()
        self._push = ZERO
        self._hand: CarryingHand | None = None
        self._deaf = self._mute = False
        self._seen_as = self._sees_as = index
        self._imu = Averages()
        self._subscribed = False
        self._receiver = Receiver(self.controller, context.airframe, p.watchdog)
        self._receiver_due: Time = 0
        self.on_touch: Callable[[Touch], None] = lambda _: None
        if context.payload is not None:
            self._arriving.append(
                (0, Payload(0, not context.payload.aboard, context.payload.aboard))
            )

    def measure(self, now: Time) -> None:
        """Make the measurements and process the commands that are due at `now`, and check the
        watchdog."""
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
            # the rotors' thrust drains the battery, which reduces their largest thrust
            onboard, index = self._world.onboard, self._index
            given = _total_thrust(onboard.rotors[index], self._thrusts())
            battery.charge.drain(given, 1.0 / battery.schedule.rate if now else 0.0)
            onboard.thrusts[index] = self._thrusts()
            battery.schedule.move_on()
        if self._receiver_due <= now:
            falling, self._receiver_due = self._receiver.descent, self._receiver.update(now)
            if self._receiver.descent is not falling:
                self._world.update_imu_readers()
            if not self._deaf:
                self.override = OWN_LANDING if self.is_descending else None
        self.due = min(capture.schedule.due, battery.schedule.due, self._receiver_due)
        if self._positions.is_wanted:
            if self._positions.schedule.due <= now:
                self._positions.measure(self.truth(), now)
            self.due = min(self.due, self._positions.schedule.due)

    @property
    def is_disturbed(self) -> bool:
        """Whether wind, forces or vibration act on the vehicle."""
        held = self._hand is not None
        return (
            self.wind.blows or self.faults.blows or held or self._push != ZERO or self._lab.disturbs
        )

    @property
    def thrust(self) -> float:
        """The sum of the rotors' thrust, N."""
        onboard, index = self._world.onboard, self._index
        return _total_thrust(onboard.rotors[index], onboard.thrusts[index])

    def jet(self) -> Jet | None:
        """Return the jet below the vehicle; None if downwash is off."""
        downwash = self._lab.downwash
        return None if downwash is None else downwash.jet(self.truth().position, self.thrust)

    def wind_at(self, now: Time, elapsed: float, jets: Sequence[Jet]) -> Vec3:
        """Return the wind at the vehicle, m/s, world frame, `elapsed` seconds after the last call:
        the world's wind plus the jets of all vehicles, whose momenta add up."""
        x, y, z = add(self.wind.after(elapsed), self.faults.wind(now))
        if jets:
            place = self.truth().position
            z -= hypot(*(jet.sinks(place) for jet in jets))
        return x, y, z

    def push(self, elapsed: float, thrust: float) -> Numbers:
        """Return the force (N, world frame) and the torque (N m, body frame) of eddies, ground
        effect, faults and a hand, `elapsed` seconds after the last call. thrust: of all rotors,
        N."""
        eddies, ground, force = self._lab.eddies, self._lab.ground, self._push
        x, y, z, *turned = NOTHING if eddies is None else eddies.after(elapsed)
        if ground is not None:
            truth = self.truth()
            lift = thrust * ground.gain(truth.position[2] + LEGS)
            force = add(force, rotate(truth.attitude, (0.0, 0.0, lift)))
        fx, fy, fz = force
        if self._hand is None:
            return (x + fx, y + fy, z + fz, *turned)
        body, seconds = self.body, self._world.now / NS
        hx, hy, hz, *turn = self._hand.push(self.truth(), seconds, body.mass, body.inertia)
        a, b, c = (own + its for own, its in zip(turned, turn, strict=True))
        return (x + fx + hx, y + fy + hy, z + fz + hz, a, b, c)

    def carry(self, way: Vec3, turn: Vec3, generator: random.Random) -> None:
        if self._hand is None:
            truth = self.truth()
            self._hand = CarryingHand(truth.position, truth.attitude, generator)
            self._world.apply_faults(self._index)
        self._hand.move(way, turn, self._world.now / NS)

    def vibration(self, thrust: float) -> float:
        """Return the vibration relative to that in hover. A rotor's imbalance grows with the square
        of its speed, and so in proportion to its thrust."""
        return thrust / (self.body.mass * GRAVITY)

    def _thrusts(self) -> Numbers:
        """Return each rotor's largest thrust at the battery's current charge."""
        sag, weak = self.battery.charge.level**2, self.faults.rotors
        return tuple(sag * f * left for f, left in zip(self.body.thrust, weak, strict=True))

    @property
    def reads_imu(self) -> bool:
        """Whether the vehicle needs the IMU's sample of every step."""
        return self._subscribed or self.is_descending

    @property
    def is_descending(self) -> bool:
        """Whether the vehicle's watchdog is landing it."""
        return self._receiver.descent is not None

    def add_imu(self, sample: Numbers) -> None:
        """Process the IMU's sample of a step."""
        self._imu.add(sample)
        self._receiver.come_down(sample[-1], self._dt)

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        if Imu in kinds and not self._subscribed:
            self._subscribed = True
            self._imu.measure(self._world.now, self._dt)  # discard earlier samples
            self._world.update_imu_readers()
        if Position in kinds and not self._positions.is_wanted:
            self._positions.begin(self._world.now)
            self.due = min(self.due, self._positions.schedule.due)
            self._world.schedule(self.due)

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
        return self.faults.filtered(arrived) if self.faults.filters else arrived

    def send(self, command: Command, now: Time) -> None:
        receiver = self._receiver
        if self._mute:
            return
        commands = self._lab.late
        late = 0 if commands is None else round(max(0.0, next(commands)[0]) * NS)
        if not (receiver.late or late):
            receiver.receive(command, now)
            return
        self._receiver_due = min(self._receiver_due, receiver.delay(command, now, late))
        self.due = min(self.due, self._receiver_due)
        self._world.schedule(self.due)

    def cut(self, now: Time) -> None:
        if not self._mute:
            self._receiver.stop()
            self._world.update_imu_readers()

    def grip(self, is_open: bool, now: Time) -> None:
        if self._mute:
            return
        on_board = self._world.grip(self._index, is_open, self.controller.armed)
        self._arriving.append((now, Payload(now, is_open, on_board)))

    def _apply_faults(self) -> None:
        faults = self.faults
        self._push = scale(faults.push, self.body.mass)
        self._deaf, self._mute = (not self.is_wired and cut for cut in (faults.deaf, faults.mute))
        self._receiver.set_delay(0 if self.is_wired else round(faults.late * NS))
        self._seen_as = self._world.index(faults.body)
        self._sees_as = self._world.index(faults.view)
        self.battery.charge.sag = faults.sag
        self.imu_bias = (*faults.gyro_bias, *faults.accelerometer_bias)
        self._world.apply_faults(self._index)

    def truth(self) -> Truth:
        return self._world.truth(self._index)

    def view(self) -> Truth:
        return self._world.truth(self._sees_as)

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        self.on_touch = tell


def _total_thrust(rotors: Numbers, most: Numbers) -> float:
    """Return the sum of the rotors' thrust, N, from their states and largest thrusts."""
    a, b, c, d = rotors
    fa, fb, fc, fd = most
    return a * fa + b * fb + c * fc + d * fd


def physics_rate(seats: Sequence[Seat]) -> int:
    """Return the physics rate of all vehicles in a world, Hz. Raises DriverError if they differ."""
    rates = {seat.params.physics for seat in seats}
    if len(rates) != 1:
        raise DriverError(f"vehicles in one world need one physics rate, found {sorted(rates)}")
    rate: int = round(rates.pop())
    return rate


def jets_of(vehicles: Sequence[SimulatedVehicle]) -> list[Jet]:
    """Return the jets below vehicles; none for a single vehicle."""
    if len(vehicles) < 2:
        return []
    return [jet for vehicle in vehicles if (jet := vehicle.jet()) is not None]
