"""The session: MuJoCo's world and its steps, in lockstep with the engine's clock."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import ZERO, conjugate, rotate
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.sim.contacts import Contacts
from kybflow.drivers.sim.model import FIRST_BODY, BuiltAirframe, loaded, world_text
from kybflow.drivers.sim.parcels import FallingParcel
from kybflow.drivers.sim.sensors import NOTHING
from kybflow.drivers.sim.steps.onboard_state import OnboardState
from kybflow.drivers.sim.steps.stepper import rows, stepper
from kybflow.drivers.sim.vehicle import SimulatedVehicle, jets_of
from kybflow.drivers.sim.viewer import Viewer
from kybflow.parts import Link, Seat, Session

if TYPE_CHECKING:
    import random

_POSITION, _POSITION_SIZE = struct.Struct("7d").unpack_from, 7 * 8
_VELOCITY, _VELOCITY_SIZE = struct.Struct("6d").unpack_from, 6 * 8
WINDS = 50.0
"""How often the air changes, Hz: eddies last half a second, whatever the rate of the control."""


class SimulatedWorld(Session):
    """Every simulated vehicle in one MuJoCo world. Raises DriverError when they disagree about the
    physics' rate, when MuJoCo refuses the model, and when the simulation diverges."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        rates = {seat.params.physics for seat in seats}
        if len(rates) != 1:
            raise DriverError(f"vehicles in one world need one physics rate, found {sorted(rates)}")
        self._rate: int = round(rates.pop())
        self.onboard = OnboardState(len(seats), rows())
        self._vehicles = [
            SimulatedVehicle(self, i, seat, generator) for i, seat in enumerate(seats)
        ]
        self.links: dict[str, Link] = {
            seat.context.vehicle: vehicle
            for seat, vehicle in zip(seats, self._vehicles, strict=True)
        }
        self.model = _compile(seats, [vehicle.body for vehicle in self._vehicles], self._rate)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        balls = {name: b for seat in seats for name, b in seat.context.moving.items()}
        self._moving = tuple(enumerate(balls.values()))
        self._parcels = _parcels(self.model, self.data, seats)
        sources = [vehicle.imu_source for vehicle in self._vehicles]
        self._stepper = stepper(self.model, self.data, self.onboard, sources)
        self._positions, self._velocities = self.data.qpos.data, self.data.qvel.data
        self._truths: dict[int, Truth] = {}
        self._listeners: list[tuple[int, SimulatedVehicle]] = []
        self._winds = self._blowing()
        for index in self._parcels:
            self.refit(index)
        self._contacts = Contacts(self.model, [seat.context.vehicle for seat in seats])
        self._blown: Time = 0
        self._due = self._next_wind = 0
        self._measure(0)
        self._viewer = Viewer(self.model, self.data) if any(s.params.live for s in seats) else None

    @property
    def now(self) -> Time:
        """The time of the last physics step."""
        return self.onboard.steps * NS // self._rate

    def find_listeners(self) -> None:
        """Find out which vehicles want what their IMU measures in each step."""
        self._listeners = [(i, v) for i, v in enumerate(self._vehicles) if v.listens]

    def advance(self, now: Time) -> None:
        last = ((now + 1) * self._rate - 1) // NS
        if self.onboard.steps >= last:
            return
        for place, ball in self._moving:
            self.data.mocap_pos[place] = ball.at(now / NS)
        while self.onboard.steps < last:
            self._step(last)
        if self._parcels:
            for parcel in self._parcels.values():
                parcel.follow()
            self._truths = {}
        data = self.data
        if data.ncon:
            for index, touch in self._contacts.begun(data, now):
                self._vehicles[index].tell_touch(touch)
        if data.time * self._rate < self.onboard.steps - 0.5:
            raise DriverError("the simulation diverged and MuJoCo started it again")
        if self._viewer is not None:
            self._viewer.show(now)

    def _step(self, last: int) -> None:
        """Step on until something is to be measured, `last` at the latest; one step where a
        vehicle's watchdog flies by what is felt in each."""
        onboard, listeners, due = self.onboard, self._listeners, self._due
        if self._winds:
            if self._next_wind <= onboard.steps:
                self._blow()
            due = min(due, self._next_wind)
        steps = max(1, min(last, due) - onboard.steps)
        if listeners and any(vehicle.falls for _, vehicle in listeners):
            steps = 1
        self._stepper.advance(steps)
        self._truths = {}
        for index, vehicle in listeners:
            for sample in self._stepper.felt(index):
                vehicle.add_imu(sample)
        if self._due <= onboard.steps:
            self._measure(self.now)

    def close(self) -> None:
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def truth(self, index: int) -> Truth:
        """The state of a vehicle now."""
        truth = self._truths.get(index)
        if truth is None:
            px, py, pz, w, x, y, z = _POSITION(self._positions, _POSITION_SIZE * index)
            vx, vy, vz, ox, oy, oz = _VELOCITY(self._velocities, _VELOCITY_SIZE * index)
            place = self._parcels[index].position if index in self._parcels else None
            truth = Truth((px, py, pz), (vx, vy, vz), (w, x, y, z), (ox, oy, oz), place)
            self._truths[index] = truth
        return truth

    def grip(self, index: int, is_open: bool, armed: bool) -> bool:
        """Open or close a vehicle's servo; whether its parcel is on board then. Raises Refused."""
        parcel = self._parcels.get(index)
        if parcel is None:
            raise Refused("it carries no payload")
        if is_open and parcel.aboard:
            parcel.release()
        elif not (is_open or armed):
            parcel.load()
        self.refit(index)
        return parcel.aboard

    def index(self, name: str) -> int:
        """The place of a vehicle."""
        return list(self.links).index(name)

    def hurry(self, due: Time) -> None:
        """Let a vehicle measure at `due`, which is earlier than it said."""
        self._due = min(self._due, self._step_of(due))

    def refit(self, index: int) -> None:
        """Obey a vehicle's rig and its parcel: its mass and inertia, its wind. The thrust of its
        rotors follows with the next report of its battery."""
        vehicle, model, parcel = self._vehicles[index], self.model, self._parcels.get(index)
        mass = vehicle.body.mass * vehicle.faults.mass + vehicle.faults.payload
        place = FIRST_BODY + index
        jx, jy, jz = (j * mass / vehicle.body.mass for j in vehicle.body.inertia)
        if parcel is not None:
            aboard = parcel.made if parcel.aboard else None
            mass, (jx, jy, jz), model.body_ipos[place, 2] = loaded(mass, (jx, jy, jz), aboard)
        model.body_inertia[place] = (jx, jy, jz)
        model.body_mass[place] = mass
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self._stepper.errors.bias(index, vehicle.imu_bias)
        self.onboard.winds[index], self.onboard.pushes[index] = ZERO, NOTHING
        self._winds, self._next_wind = self._blowing(), 0
        self._truths = {}

    def _blowing(self) -> list[tuple[int, SimulatedVehicle]]:
        return [(i, v) for i, v in enumerate(self._vehicles) if v.is_blown]

    def _measure(self, now: Time) -> None:
        for vehicle in self._vehicles:
            if vehicle.due <= now:
                vehicle.measure(now)
        self._due = self._step_of(min(vehicle.due for vehicle in self._vehicles))

    def _step_of(self, due: Time) -> int:
        """The first physics step that does not end before `due`."""
        return -(-due * self._rate // NS)

    def _blow(self) -> None:
        """Give each vehicle the wind along its body's axes, what else pushes it, and how much it
        vibrates, until `_next_wind`."""
        now = (self.onboard.steps + 1) * NS // self._rate
        self._next_wind = self.onboard.steps + max(1, round(self._rate / WINDS))
        elapsed, self._blown = (now - self._blown) / NS, now
        jets = jets_of([vehicle for _, vehicle in self._winds])
        for index, vehicle in self._winds:
            to_body = conjugate(self.truth(index).attitude)
            self.onboard.winds[index] = rotate(to_body, vehicle.blown(now, elapsed, jets))
            thrust = vehicle.thrust
            self.onboard.pushes[index] = vehicle.pushed(elapsed, thrust)
            self._stepper.errors.shake(index, vehicle.vibration(thrust))


def _parcels(
    model: mujoco.MjModel, data: mujoco.MjData, seats: Sequence[Seat]
) -> dict[int, FallingParcel]:
    """The parcel of each vehicle that has one, by the vehicle's place."""
    made = [
        (index, p) for index, seat in enumerate(seats) if (p := seat.context.payload) is not None
    ]
    first = len(seats)
    return {
        index: FallingParcel(model, data, index, first + number, parcel)
        for number, (index, parcel) in enumerate(made)
    }


def _compile(seats: Sequence[Seat], bodies: Sequence[BuiltAirframe], rate: float) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_string(
            world_text([seat.context for seat in seats], bodies, 1.0 / rate)
        )
    except ValueError as error:
        raise DriverError(f"MuJoCo refuses the world: {error}") from error
