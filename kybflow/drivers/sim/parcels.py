"""Parcels, which are part of the vehicle's body while on board and separate boxes after the
release.

A carried parcel is a cube whose lower side is level with the legs. It adds to the vehicle's mass
and inertia (`model.loaded`); its own MuJoCo body is weightless, touches nothing and follows the
vehicle. A released parcel starts with the velocity that it had on board, v + w x r, while the
vehicle keeps its own. It collides with the floor, obstacles and other parcels at once. It collides
with vehicles only when it is clear of its carrier, since a box released on the ground lies between
the legs.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from kybflow.core.geometry import Vec3, add, cross, distance, norm, rotate
from kybflow.drivers.sim.model import FIRST_BODY, mount
from kybflow.world.vehicle_context import LEGS, Parcel

_NOTHING, _LEAVING, _CLEAR = 0, 2, 3
"""Bits for what a parcel collides with: 1 for vehicles, 2 for everything else. The parcel is on
board, released but near its carrier, or clear of it."""


class FallingParcel:
    """The parcel of the vehicle at `index`, which is the free body `number` of MuJoCo's world.
    made: the parcel's size and mass."""

    def __init__(self, model: Any, data: Any, index: int, number: int, made: Parcel) -> None:
        self.made, self.on_board = made, made.aboard
        self._model, self._body = model, FIRST_BODY + number
        self._geom = int(model.body_geomadr[self._body])
        self._carrier, self._carried = data.qpos[7 * index :][:7], data.qvel[6 * index :][:6]
        self._place, self._speed = data.qpos[7 * number :][:7], data.qvel[6 * number :][:6]
        self._offset = (0.0, 0.0, mount(made))
        arm = float(norm(tuple(model.geom_size[model.body_geomadr[FIRST_BODY + index]])))
        self._reach = arm + LEGS + 0.5 * sqrt(3.0) * made.size
        self._touches = _NOTHING
        if not self.on_board:
            self._set_weight(weight=True)

    @property
    def position(self) -> Vec3:
        x, y, z = self._place[:3].tolist()
        return (x, y, z)

    def release(self) -> None:
        """Release the parcel with its current velocity."""
        self.on_board = False
        self._follow_carrier()
        vx, vy, vz, *turn = self._carried.tolist()
        attitude = tuple(self._carrier[3:].tolist())
        along = rotate(attitude, cross((turn[0], turn[1], turn[2]), self._offset))
        self._speed[:] = (*add((vx, vy, vz), along), *turn)
        self._set_weight(weight=True)

    def load(self) -> None:
        self.on_board = True
        self._set_weight(weight=False)
        self._follow_carrier()

    def follow(self) -> None:
        """Update the parcel once a tick: move it with the vehicle while on board; after the
        release, let it collide with vehicles once it is clear of its carrier."""
        if self.on_board:
            self._follow_carrier()
        elif self._touches == _LEAVING:
            x, y, z = self._carrier[:3].tolist()
            if distance((x, y, z), self.position) > self._reach:
                self._touch(_CLEAR)

    def _follow_carrier(self) -> None:
        x, y, z, *turned = self._carrier.tolist()
        attitude = (turned[0], turned[1], turned[2], turned[3])
        self._place[:] = (*add((x, y, z), rotate(attitude, self._offset)), *attitude)
        self._speed[:] = 0.0

    def _set_weight(self, weight: bool) -> None:
        self._model.body_gravcomp[self._body] = 0.0 if weight else 1.0
        self._touch(_LEAVING if weight else _NOTHING)

    def _touch(self, what: int) -> None:
        model, self._touches = self._model, what
        model.geom_contype[self._geom] = model.geom_conaffinity[self._geom] = what
        model.body_contype[self._body] = model.body_conaffinity[self._body] = what
