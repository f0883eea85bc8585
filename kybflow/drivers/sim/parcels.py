"""Parcels: a part of the vehicle's body while on board, a box of its own from then on.

On board a parcel is a cube whose lower side is level with the legs, rigid with the vehicle: only
its mass counts, as `model.loaded` adds it up, and it touches nothing. Released, it leaves with the
velocity that it had at its place, v + w x r; what is left of the vehicle keeps its own. It collides
with the floor, with obstacles and with other parcels at once, and with vehicles as soon as it is
clear of the one that carried it: a box that is let go on the ground lies between the legs.

On board its own body in MuJoCo is weightless and touches nothing; it is put where the parcel is.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from kybflow.core.geometry import Vec3, add, cross, distance, norm, rotate
from kybflow.drivers.sim.model import FIRST_BODY, mount
from kybflow.world.vehicle_context import LEGS, Parcel

_NOTHING, _LEAVING, _CLEAR = 0, 2, 3
"""What a parcel touches, as bits: 1 vehicles, 2 all else."""


class FallingParcel:
    """The parcel of the vehicle at `index` of MuJoCo's world, itself the free body `number` there;
    `made` is what it is made like."""

    def __init__(self, model: Any, data: Any, index: int, number: int, made: Parcel) -> None:
        self.made, self.aboard = made, made.aboard
        self._model, self._body = model, FIRST_BODY + number
        self._geom = int(model.body_geomadr[self._body])
        self._carrier, self._carried = data.qpos[7 * index :][:7], data.qvel[6 * index :][:6]
        self._place, self._speed = data.qpos[7 * number :][:7], data.qvel[6 * number :][:6]
        self._offset = (0.0, 0.0, mount(made))
        arm = float(norm(tuple(model.geom_size[model.body_geomadr[FIRST_BODY + index]])))
        self._reach = arm + LEGS + 0.5 * sqrt(3.0) * made.size
        self._touches = _NOTHING
        if not self.aboard:
            self._fall(weight=True)

    @property
    def position(self) -> Vec3:
        """Its centre."""
        x, y, z = self._place[:3].tolist()
        return (x, y, z)

    def release(self) -> None:
        """Let it go with the velocity that it has."""
        self.aboard = False
        self._ride()
        vx, vy, vz, *turn = self._carried.tolist()
        attitude = tuple(self._carrier[3:].tolist())
        along = rotate(attitude, cross((turn[0], turn[1], turn[2]), self._offset))
        self._speed[:] = (*add((vx, vy, vz), along), *turn)
        self._fall(weight=True)

    def load(self) -> None:
        """Put it on board."""
        self.aboard = True
        self._fall(weight=False)
        self._ride()

    def follow(self) -> None:
        """Go on from the last tick: on board it goes with its vehicle; clear of it, it touches
        vehicles too."""
        if self.aboard:
            self._ride()
        elif self._touches == _LEAVING and self._away() > self._reach:
            self._touch(_CLEAR)

    def _ride(self) -> None:
        x, y, z, *turned = self._carrier.tolist()
        attitude = (turned[0], turned[1], turned[2], turned[3])
        self._place[:] = (*add((x, y, z), rotate(attitude, self._offset)), *attitude)
        self._speed[:] = 0.0

    def _away(self) -> float:
        x, y, z = self._carrier[:3].tolist()
        return distance((x, y, z), self.position)

    def _fall(self, weight: bool) -> None:
        self._model.body_gravcomp[self._body] = 0.0 if weight else 1.0
        self._touch(_LEAVING if weight else _NOTHING)

    def _touch(self, what: int) -> None:
        model, self._touches = self._model, what
        model.geom_contype[self._geom] = model.geom_conaffinity[self._geom] = what
        model.body_contype[self._body] = model.body_conaffinity[self._body] = what
