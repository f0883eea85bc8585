"""Ideal vehicles without physics, which follow every command at once and exactly.

A vehicle follows a setpoint's position, velocity or acceleration, or an attitude or body rates with
the thrust of its nominal mass. Setpoints move it at most twice as fast as its airframe may fly, so
that a setpoint that jumps doesn't carry it through a wall. The floor, stands and obstacles carry a
vehicle from below; otherwise it reports a collision and passes through. There is no wind, delay,
noise or fault. The battery drains as in `sim`. `kybflow rehearse` flies on this driver; such
flights don't predict tracking errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.signals import Battery, CommandKind, Imu, Odometry, Pose, Position
from kybflow.core.units import Ratio
from kybflow.parts import Driver, Seat, Session, param, params

if TYPE_CHECKING:
    import random


@params
class KinematicParams:
    battery: Ratio = param(
        "Charge of the battery at the start.", default=1.0, above=0.0, at_most=1.0, read_only=True
    )


class Kinematic(Driver[KinematicParams]):
    accepts = frozenset(CommandKind)
    provides = frozenset({Battery, Imu, Odometry, Pose, Position})
    simulated: ClassVar[bool] = True
    shared: ClassVar[bool] = False
    grips: ClassVar[bool] = True

    @classmethod
    def tracker(cls, params: KinematicParams) -> Mapping[str, str]:
        return {"use": "on_board"}

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.kinematic.world import KinematicWorld

        return KinematicWorld(seats)

    @classmethod
    def world(cls, params: KinematicParams) -> str:
        return "an ideal vehicle without physics"

    @classmethod
    def control_rate(cls, params: KinematicParams) -> int:
        return 50
