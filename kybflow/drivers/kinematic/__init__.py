"""Ideal vehicles without physics: each does at once and exactly what it is commanded.

It follows a setpoint's position, velocity or acceleration, and an attitude or body rates with the
thrust of its nominal mass. Setpoints move it no faster than twice what its airframe may fly, so
that one that jumps is not reached through a wall. The floor, stands and obstacles carry it; nothing
else stops it: what it runs into is told, and it goes on. The air stands still, nothing is late,
nothing is measured wrongly. The battery drains as the simulator's does. There are no faults here.
`kybflow rehearse` flies on it; figures of such a flight say nothing of tracking.
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
