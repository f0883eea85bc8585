"""The session of simulated vehicles: MuJoCo's world, stepped in lockstep with the engine's clock,
its contacts and its viewer."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mujoco

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import ZERO, conjugate, rotate
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.sim.model import (
    FIRST_BODY,
    FLOOR,
    OBJECT,
    OBSTACLE,
    PARCEL,
    BuiltAirframe,
    FallingParcel,
    loaded,
    world_text,
)
from kybflow.drivers.sim.objects import SimulatedObjects, object_of, objects_text
from kybflow.drivers.sim.sensors import NOTHING
from kybflow.drivers.sim.steps.onboard import OnboardState
from kybflow.drivers.sim.steps.stepper import rows, stepper
from kybflow.drivers.sim.vehicle import TOUCH_GAP, SimulatedVehicle, jets_of, physics_rate
from kybflow.parts import Link, Seat, Session
from kybflow.parts.link import Touch

if TYPE_CHECKING:
    import random

_POSITION, _POSITION_SIZE = struct.Struct("7d").unpack_from, 7 * 8
_VELOCITY, _VELOCITY_SIZE = struct.Struct("6d").unpack_from, 6 * 8
DISTURBANCE_RATE = 50.0
"""Rate at which wind and other disturbances change, Hz; eddies last half a second."""
CARRYING_NORMAL = 0.8
"""Upward part of a contact's unit normal above which the contact carries the vehicle."""
VIEWER_PERIOD: Time = NS // 60
LOOK_AT = (0.0, 0.0, 0.8)
DISTANCE = 5.0
"""The viewer's first view: a room of a few metres, seen from the south-east corner."""


class SimulatedWorld(Session):
    """All simulated vehicles in one MuJoCo world. Raises DriverError if their physics rates differ,
    if MuJoCo rejects the model, or if the simulation diverges."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        self._rate = physics_rate(seats)
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
        self._imu_readers: list[tuple[int, SimulatedVehicle]] = []
        self._disturbed = self._find_disturbed()
        for index in self._parcels:
            self.apply_faults(index)
        self._contacts = Contacts(self.model, [seat.context.vehicle for seat in seats])
        self.scene = self._objects = SimulatedObjects(
            self.model, self.data, seats[0].context.objects, self._contacts.vehicles
        )
        self._disturbed_at: Time = 0
        self._due = self._next_disturbance = 0
        self._measure(0)
        self._viewer = Viewer(self.model, self.data) if any(s.params.live for s in seats) else None

    @property
    def now(self) -> Time:
        """The time of the last physics step."""
        return self.onboard.steps * NS // self._rate

    def update_imu_readers(self) -> None:
        """Update the list of vehicles that need the IMU's sample of every step."""
        self._imu_readers = [(i, v) for i, v in enumerate(self._vehicles) if v.reads_imu]

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
                self._vehicles[index].on_touch(touch)
        if data.time * self._rate < self.onboard.steps - 0.5:
            raise DriverError("the simulation diverged and MuJoCo restarted it")
        if self._viewer is not None:
            self._viewer.show(now)

    def _step(self, last: int) -> None:
        """Step until a measurement or disturbance is due, but not beyond the step `last`. While a
        watchdog lands a vehicle, make single steps."""
        onboard, readers, due = self.onboard, self._imu_readers, self._due
        if self._disturbed:
            if self._next_disturbance <= onboard.steps:
                self._disturb()
            due = min(due, self._next_disturbance)
        steps = max(1, min(last, due) - onboard.steps)
        if readers and any(vehicle.is_descending for _, vehicle in readers):
            steps = 1
        if self._objects.resists:
            self._objects.resist(steps / self._rate)
        self._stepper.advance(steps)
        self._truths = {}
        for samples in self._stepper.imu_samples() if readers else ():
            for index, vehicle in readers:
                vehicle.add_imu(samples[index])
        if self._due <= onboard.steps:
            self._measure(self.now)

    def close(self) -> None:
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def truth(self, index: int) -> Truth:
        truth = self._truths.get(index)
        if truth is None:
            px, py, pz, w, x, y, z = _POSITION(self._positions, _POSITION_SIZE * index)
            vx, vy, vz, ox, oy, oz = _VELOCITY(self._velocities, _VELOCITY_SIZE * index)
            place = self._parcels[index].position if index in self._parcels else None
            truth = Truth((px, py, pz), (vx, vy, vz), (w, x, y, z), (ox, oy, oz), place)
            self._truths[index] = truth
        return truth

    def grip(self, index: int, is_open: bool, armed: bool) -> bool:
        """Open or close a vehicle's servo. Return whether its parcel is on board. Raises Refused if
        the vehicle carries no parcel."""
        parcel = self._parcels.get(index)
        if parcel is None:
            raise Refused("it carries no payload")
        if is_open and parcel.on_board:
            parcel.release()
        elif not (is_open or armed):
            parcel.load()
        self.apply_faults(index)
        return parcel.on_board

    def index(self, name: str) -> int:
        return list(self.links).index(name)

    def schedule(self, due: Time) -> None:
        """Ensure that a vehicle measures at `due`, if that is earlier than planned."""
        self._due = min(self._due, self._step_of(due))

    def apply_faults(self, index: int) -> None:
        """Apply a vehicle's faults and its parcel: mass, inertia, IMU bias and disturbances. The
        thrust of its rotors changes with the next battery report."""
        vehicle, model, parcel = self._vehicles[index], self.model, self._parcels.get(index)
        mass = vehicle.body.mass * vehicle.faults.mass + vehicle.faults.payload
        place = FIRST_BODY + index
        jx, jy, jz = (j * mass / vehicle.body.mass for j in vehicle.body.inertia)
        if parcel is not None:
            carried = parcel.made if parcel.on_board else None
            mass, inertia, model.body_ipos[place, 2] = loaded(mass, (jx, jy, jz), carried)
            jx, jy, jz = inertia
        model.body_inertia[place] = (jx, jy, jz)
        model.body_mass[place] = mass
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self._stepper.errors.bias(index, vehicle.imu_bias)
        self.onboard.winds[index], self.onboard.pushes[index] = ZERO, NOTHING
        self._disturbed, self._next_disturbance = self._find_disturbed(), 0
        self._truths = {}

    def _find_disturbed(self) -> list[tuple[int, SimulatedVehicle]]:
        return [(i, v) for i, v in enumerate(self._vehicles) if v.is_disturbed]

    def _measure(self, now: Time) -> None:
        for vehicle in self._vehicles:
            if vehicle.due <= now:
                vehicle.measure(now)
        self._due = self._step_of(min(vehicle.due for vehicle in self._vehicles))

    def _step_of(self, due: Time) -> int:
        """Return the first physics step that ends at or after `due`."""
        return -(-due * self._rate // NS)

    def _disturb(self) -> None:
        """Set each vehicle's wind (body axes), force, torque and vibration until
        `_next_disturbance`."""
        now = (self.onboard.steps + 1) * NS // self._rate
        self._next_disturbance = self.onboard.steps + max(1, round(self._rate / DISTURBANCE_RATE))
        elapsed, self._disturbed_at = (now - self._disturbed_at) / NS, now
        jets = jets_of([vehicle for _, vehicle in self._disturbed])
        for index, vehicle in self._disturbed:
            to_body = conjugate(self.truth(index).attitude)
            self.onboard.winds[index] = rotate(to_body, vehicle.wind_at(now, elapsed, jets))
            thrust = vehicle.thrust
            self.onboard.pushes[index] = vehicle.push(elapsed, thrust)
            self._stepper.errors.shake(index, vehicle.vibration(thrust))


def _parcels(
    model: mujoco.MjModel, data: mujoco.MjData, seats: Sequence[Seat]
) -> dict[int, FallingParcel]:
    """Return the parcels by the index of their vehicles."""
    made = [
        (index, p) for index, seat in enumerate(seats) if (p := seat.context.payload) is not None
    ]
    first = len(seats)
    return {
        index: FallingParcel(model, data, index, first + number, parcel)
        for number, (index, parcel) in enumerate(made)
    }


def _compile(seats: Sequence[Seat], bodies: Sequence[BuiltAirframe], rate: float) -> mujoco.MjModel:
    objects = objects_text(seats[0].context.objects)
    try:
        return mujoco.MjModel.from_xml_string(
            world_text([seat.context for seat in seats], bodies, 1.0 / rate, objects)
        )
    except ValueError as error:
        raise DriverError(f"MuJoCo refuses the world: {error}") from error


class Contacts:
    """Detects contacts between vehicles and other things. vehicles: their names in the order of
    their bodies; then the name of each geom's vehicle."""

    def __init__(self, model: Any, vehicles: Sequence[str]) -> None:
        bodies: list[int] = model.geom_bodyid.tolist()
        beyond = FIRST_BODY + len(vehicles)
        self._vehicles = {
            geom: body - FIRST_BODY
            for geom, body in enumerate(bodies)
            if FIRST_BODY <= body < beyond
        }
        named = (model.geom(number).name for number in range(model.ngeom))
        self._names = [
            _name_of(name or model.body(body).name)
            for name, body in zip(named, bodies, strict=True)
        ]
        self.vehicles = {geom: vehicles[index] for geom, index in self._vehicles.items()}
        for geom, name in self.vehicles.items():
            self._names[geom] = name
        self._touched: dict[tuple[int, str, bool], Time] = {}

    def begun(self, data: Any, now: Time) -> list[tuple[int, Touch]]:
        """Return the index of each vehicle that starts to touch something at `now`, and the
        touch."""
        vehicles, contact = self._vehicles, data.contact
        found: list[tuple[int, Touch]] = []
        for (first, second), frame in zip(contact.geom.tolist(), contact.frame, strict=True):
            up = float(frame[2])  # of the normal, which points from the first to the second
            if first in vehicles:
                self._add(vehicles[first], second, -up, now, found)
            if second in vehicles:
                self._add(vehicles[second], first, up, now, found)
        return found

    def _add(
        self, vehicle: int, geom: int, up: float, now: Time, found: list[tuple[int, Touch]]
    ) -> None:
        """Add the touch of a vehicle and a geom to `found` if it is new. up: upward part of the
        contact's force on the vehicle. Standing on another vehicle doesn't count as being
        carried."""
        touch = Touch(self._names[geom], up > CARRYING_NORMAL and geom not in self._vehicles)
        last = self._touched.get((vehicle, *touch))
        self._touched[vehicle, *touch] = now
        if last is None or now - last > TOUCH_GAP:
            found.append((vehicle, touch))


def _name_of(geom: str) -> str:
    """Return the name to report for a geom that belongs to no vehicle."""
    if geom.startswith(PARCEL):
        return f"the payload of {geom.removeprefix(PARCEL)}"
    if geom.startswith(OBSTACLE):
        return geom.removeprefix(OBSTACLE)
    if geom.startswith(OBJECT):
        return object_of(geom)[0]
    return "the floor" if geom == FLOOR else "a stand"


class Viewer:
    """MuJoCo's viewer, updated 60 times per simulated second. Raises DriverError if there is no
    display."""

    def __init__(self, model: Any, data: Any) -> None:
        import warnings

        import glfw

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not glfw.init():
                raise DriverError("--live needs a display, and there is none; fly without --live")
        import mujoco.viewer

        self._handle = mujoco.viewer.launch_passive(
            model, data, show_left_ui=False, show_right_ui=False
        )
        with self._handle.lock():
            camera = self._handle.cam
            camera.lookat[:] = LOOK_AT
            camera.distance, camera.elevation, camera.azimuth = DISTANCE, -20.0, 135.0
        self._due: Time = 0

    def show(self, now: Time) -> None:
        if now >= self._due and self._handle.is_running():
            self._handle.sync()
            self._due = now + VIEWER_PERIOD

    def close(self) -> None:
        self._handle.close()
