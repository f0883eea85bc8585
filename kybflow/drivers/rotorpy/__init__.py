"""Quadrotors that move by the equations of rotorpy, a simulator by other authors.

Everything else is that of `sim`: the on-board loop, the IMU, motion capture, the battery, the link
and its faults. Mass, inertia, arms, thrust and the rotors' time constant are the airframe's, within
`model_error`. The aerodynamics are those of rotorpy's AscTec Hummingbird (`aerodynamics`); the drag
of the airframe, `drag_error` and `inflow` have no effect. This tests a controller on a vehicle
model that it was not designed for.

rotorpy has a floor and no obstacles. A vehicle that comes nearer to an obstacle than its arm's
length, or to another vehicle than both arms together, reports a collision, but nothing stops it.
The compiler rejects payloads, the viewer, and vehicles that don't start on the floor. A step of
2 ms takes about 2 ms to compute. Requires `pip install 'kybflow[rotorpy]'`.

Source: Folk, Paulos and Kumar, RotorPy, arXiv 2306.04485.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Battery, CommandKind, Imu, Pose, Position
from kybflow.core.units import Number
from kybflow.drivers.sim import Sim, SimParams
from kybflow.parts import Air, Driver, Seat, Session, param, params
from kybflow.parts.base import Objection
from kybflow.world.vehicle_context import Airframe, InnerLoop, Parcel

if TYPE_CHECKING:
    import random


@params
class RotorpyParams(SimParams):
    aerodynamics: Number = param(
        "Drag, inflow and translational lift over the Hummingbird's, both over the mass.",
        default=1.0, at_least=0.0, at_most=5.0, read_only=True,
    )  # fmt: skip


class Rotorpy(Driver[RotorpyParams]):
    """The driver; it imports rotorpy only when it is opened."""

    accepts = frozenset({CommandKind.ATTITUDE_THRUST})
    provides = frozenset({Pose, Battery, Imu, Position})
    simulated: ClassVar[bool] = True
    shared: ClassVar[bool] = False
    packages = ("rotorpy",)
    brings = ("simulated_camera",)
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {"rotorpy": {}}

    @classmethod
    def objection(
        cls, params: RotorpyParams, start: Vec3, payload: Parcel | None
    ) -> Objection | None:
        if params.live:
            return Objection("live", "rotorpy has no viewer", "fly on `sim` to watch the flight")
        if payload is not None:
            return Objection("payload", "rotorpy does not support payloads", "fly it on `sim`")
        if start[2] != 0.0:
            reason = f"rotorpy has only a floor at z = 0, but this start is at z = {start[2]:g} m"
            return Objection("start", reason, "fly it on `sim`")
        return None

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.rotorpy.world import RotorpyWorld

        return RotorpyWorld(seats, generator)

    @classmethod
    def watchdog(cls, params: RotorpyParams) -> str | None:
        return (
            None
            if params.watchdog
            else "`watchdog` is off: nothing lands the vehicle if this program stops"
        )

    @classmethod
    def world(cls, params: RotorpyParams) -> str:
        return f"{Sim.world(params)}, by rotorpy"

    @classmethod
    def air(cls, params: RotorpyParams) -> Air:
        return Sim.air(params)

    @classmethod
    def inner_loop(cls, params: RotorpyParams, airframe: Airframe) -> InnerLoop:
        return Sim.inner_loop(params, airframe)

    @classmethod
    def step_rate(cls, params: RotorpyParams) -> float | None:
        return params.physics
