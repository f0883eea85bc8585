"""The session: MuJoCo's world and its steps, in lockstep with the engine's clock."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from math import exp, sqrt
from typing import TYPE_CHECKING

import mujoco

from kybflow.drivers.sim.model import ACTUATORS, SENSORS, world_text
from kybflow.drivers.sim.vehicle import Vehicle
from kybflow.drivers.sim.viewer import Viewer
from kybflow.errors import DriverError
from kybflow.geometry import Vec3, conjugate, rotate
from kybflow.parts import Link, Seat, Session
from kybflow.signals import NS, Time, Truth

if TYPE_CHECKING:
    import random

GUST_TIME = 1.0
POSITIONS, VELOCITIES, ROTORS = 7, 6, 4


class World(Session):
    """Every simulated vehicle in one MuJoCo world. Raises DriverError when they disagree about the
    physics' rate, when MuJoCo refuses the model, and when the simulation diverges."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        rates = {seat.params.physics for seat in seats}
        if len(rates) != 1:
            raise DriverError(f"vehicles in one world need one physics rate, found {sorted(rates)}")
        self._rate: float = rates.pop()
        self._vehicles = [Vehicle(self, i, seat, generator) for i, seat in enumerate(seats)]
        self.links: dict[str, Link] = {
            seat.site.vehicle: vehicle
            for seat, vehicle in zip(seats, self._vehicles, strict=True)
        }
        bodies = [vehicle.body for vehicle in self._vehicles]
        text = world_text([seat.site for seat in seats], bodies, 1.0 / self._rate)
        try:
            self.model = mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise DriverError(f"MuJoCo refuses the world: {error}") from error
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self._control = [0.0] * (ACTUATORS * len(seats))
        self._pack = struct.Struct(f"{len(self._control)}d").pack_into
        self._pilots = [
            (vehicle.pilot.update, SENSORS * i, ACTUATORS * i)
            for i, vehicle in enumerate(self._vehicles)
        ]
        self._steps = 0
        self._next: Time = round(NS / self._rate)
        self._blown: Time = 0
        self._due: Time = 0
        self._wind = [(i, seat.params.wind, seat.params.gust) for i, seat in enumerate(seats)
                      if seat.params.gust > 0.0 or any(seat.params.wind)]
        self._gusts: list[Vec3] = [(0.0, 0.0, 0.0)] * len(seats)
        self._measure(0)
        self._viewer = Viewer(self.model, self.data) if any(s.params.live for s in seats) else None

    def advance(self, now: Time) -> None:
        if self._next > now:
            return
        if self._wind:
            self._blow()
        model, data, step = self.model, self.data, mujoco.mj_step
        control, pack, pilots = self._control, self._pack, self._pilots
        while (time := self._next) <= now:
            pack(data.ctrl, 0, *control)
            step(model, data)
            felt = data.sensordata.tolist()
            for update, s, c in pilots:
                control[c : c + 4] = update(
                    felt[s], felt[s + 1], felt[s + 2], felt[s + 3], felt[s + 4], felt[s + 5]
                )
            self._steps += 1
            self._next = round((self._steps + 1) * NS / self._rate)
            if self._due <= time:
                self._measure(time)
        if abs(data.time - self._steps / self._rate) > 0.5 / self._rate:
            raise DriverError("the simulation diverged and MuJoCo started it again")
        if self._viewer is not None:
            self._viewer.show(now)

    def close(self) -> None:
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def truth(self, index: int) -> Truth:
        """The state of a vehicle now."""
        at, by = POSITIONS * index, VELOCITIES * index
        px, py, pz, w, x, y, z = self.data.qpos[at : at + POSITIONS].tolist()
        vx, vy, vz, ox, oy, oz = self.data.qvel[by : by + VELOCITIES].tolist()
        return Truth((px, py, pz), (vx, vy, vz), (w, x, y, z), (ox, oy, oz))

    def load(self, index: int, now: Time) -> None:
        """Drain a vehicle's battery by what its rotors give, and let their thrust sag with it."""
        vehicle = self._vehicles[index]
        largest = vehicle.body.thrust
        rotors = self.data.act[ROTORS * index : ROTORS * (index + 1)].tolist()
        sag = vehicle.cell.level**2
        thrust = sag * sum(a * b for a, b in zip(rotors, largest, strict=True))
        vehicle.cell.drain(thrust, 1.0 / vehicle.cell.schedule.rate if now else 0.0)
        sag = vehicle.cell.level**2
        first = ACTUATORS * index
        self.model.actuator_gainprm[first : first + ROTORS, 0] = [sag * f for f in largest]

    def _measure(self, now: Time) -> None:
        for vehicle in self._vehicles:
            if vehicle.due <= now:
                vehicle.measure(now)
        self._due = min(vehicle.due for vehicle in self._vehicles)

    def _blow(self) -> None:
        """Wind and gusts on each body. Gusts are an Ornstein-Uhlenbeck process."""
        elapsed = (self._next - self._blown) / NS
        keep = exp(-elapsed / GUST_TIME)
        kick = sqrt(1.0 - keep * keep)
        for index, (wx, wy, wz), deviation in self._wind:
            (gx, gy, gz), (nx, ny, nz) = self._gusts[index], next(self._vehicles[index].gusts)
            s = kick * deviation
            gust = (keep * gx + s * nx, keep * gy + s * ny, keep * gz + s * nz)
            self._gusts[index] = gust
            wind = (wx + gust[0], wy + gust[1], wz + gust[2])
            bx, by, _ = rotate(conjugate(self.truth(index).attitude), wind)
            self._control[ACTUATORS * index + 4] = bx
            self._control[ACTUATORS * index + 5] = by
        self._blown = self._next
