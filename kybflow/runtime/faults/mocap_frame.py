"""The frame of motion capture is not the declared one: another unit, other axes, a rotated body.

A pose becomes, in this order,

    p' = factor M E p,    R' = (M E) R (M E)^-1 C

E exchanges two axes of the world, M mirrors one, and C turns the body about its z axis by `turned`,
as if its x axis had been defined beside the nose. `exchanged: yz` with `mirrored: y` is a world
with z up that is read as one with y up. The noise is turned and scaled with the pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from kybflow.core.geometry import from_heading, multiply
from kybflow.core.signals import Measurement, Pose
from kybflow.core.units import Angle, Number
from kybflow.parts import Effect, Fault, param, params

_ORDERS = {None: (0, 1, 2), "xy": (1, 0, 2), "yz": (0, 2, 1), "xz": (2, 1, 0)}


@params
class MocapFrameParams:
    turned: Angle = param(
        "Angle by which the body's definition is rotated to the left.", default=0.0, read_only=True
    )
    mirrored: Literal["x", "y", "z"] | None = param(
        "The axis that is mirrored.", default=None, read_only=True
    )
    exchanged: Literal["xy", "yz", "xz"] | None = param(
        "The axes that are exchanged before one is mirrored.", default=None, read_only=True
    )
    factor: Number = param(
        "Factor of all positions: 0.001 for metres that are read as millimetres.",
        default=1.0, above=0.0, read_only=True,
    )  # fmt: skip


class MocapFrame(Fault[MocapFrameParams]):
    spoils = Pose
    ours = True

    @classmethod
    def is_nothing(cls, params: MocapFrameParams) -> bool:
        return params == MocapFrameParams()

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=self._change)}

    def _change(self, measurement: Measurement) -> Measurement | None:
        if not isinstance(measurement, Pose):
            return measurement
        p, (i, j, k) = self.params, _ORDERS[self.params.exchanged]
        signs = [-1.0 if axis == p.mirrored else 1.0 for axis in "xyz"]
        hand = -1.0 if (p.exchanged is None) is (p.mirrored is not None) else 1.0
        at, (w, *turn) = measurement.position, measurement.attitude
        sx, sy, sz = (p.factor * sign for sign in signs)
        hx, hy, hz = (hand * sign for sign in signs)
        return Pose(
            measurement.time,
            (sx * at[i], sy * at[j], sz * at[k]),
            multiply((w, hx * turn[i], hy * turn[j], hz * turn[k]), from_heading(p.turned)),
        )
