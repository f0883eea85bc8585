"""Push the setpoint away from obstacles and other vehicles by TeleKyb's cotangent potential.

It works like PMObsAvoid and VMObsAvoid, with their defaults: the repulsion, at most `speed`, is
added to a velocity setpoint; a position setpoint is replaced by a reference that is pushed away
with at most `velocity` and `acceleration` and returns when nothing repels it any more. The formula
and the differences are described in `Potential`. It ignores the fence. If
nothing is in reach, setpoints pass bit for bit.

It guarantees no distance: it ignores speeds and braking, and repulsions from two sides cancel. It
serves as a comparison; `avoid_obstacles` keeps a distance. It acts in behaviors that stay in the
air. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf, pi, sqrt, tan
from typing import ClassVar, NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, scale
from kybflow.core.signals import Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Length, Number, Speed
from kybflow.flight.avoidance.surroundings import Hazard, Nearby
from kybflow.flight.governor import Follower, shortened
from kybflow.flight.motion import motion_of
from kybflow.parts import Objection, Processor, param, params
from kybflow.world.vehicle_context import VehicleContext


class Potential(NamedTuple):
    """The repulsion of TeleKyb's obstacle potential.

    An obstacle at the distance d from an ellipsoid around the vehicle, along the line to it,
    repels the vehicle with the speed

        s(d) = g (pi/2) / (d0 - dm) (cot z + z - pi/2),    z = (pi/2) (d - dm) / (d0 - dm),

    which is zero from d0 on and saturates below dm, and inside the ellipsoid. Contributions are
    added and the sum is limited, so that their order doesn't matter; TeleKyb's running average
    forgot what came before an obstacle out of reach. World frame, metres.

    level, above: semi-axes of the ellipsoid. nearest,
    farthest: the distances dm and d0. gain: the factor g. saturation: the largest speed of
    repulsion, m/s.
    """

    level: float
    above: float
    nearest: float
    farthest: float
    gain: float
    saturation: float

    @property
    def reach(self) -> float:
        """The distance beyond which nothing repels in any direction."""
        return self.farthest + max(self.level, self.above)


def repulsion(distance: float, potential: Potential) -> float:
    """Return the speed (m/s) away from something at this distance from the ellipsoid."""
    if distance >= potential.farthest:
        return 0.0
    if distance <= potential.nearest:
        return potential.saturation
    steepness = 0.5 * pi / (potential.farthest - potential.nearest)
    z = steepness * (distance - potential.nearest)
    return min(potential.gain * steepness * (1.0 / tan(z) + z - 0.5 * pi), potential.saturation)


def push(hazards: Iterable[Hazard], potential: Potential) -> Vec3:
    """Return the velocity away from everything near; the object ZERO if nothing repels."""
    whole = ZERO
    for hazard in hazards:
        x, y, z = hazard.outward
        radius = 1.0 / sqrt((x * x + y * y) / potential.level**2 + z * z / potential.above**2)
        speed = repulsion(hazard.room - radius, potential)
        if speed > 0.0:
            whole = add(whole, scale(hazard.outward, speed))
    return whole if whole is ZERO else shortened(whole, potential.saturation)


@params
class PotentialFieldParams:
    level: Length = param(
        "Horizontal semi-axis of the ellipsoid around the vehicle.", default=0.4, above=0.0
    )
    above: Length = param("Vertical semi-axis of the ellipsoid.", default=0.15, above=0.0)
    nearest: Length = param(
        "Distance from the ellipsoid at which the repulsion is largest.",
        default=0.2, at_least=0.0, room="across",
    )  # fmt: skip
    farthest: Length = param(
        "Distance beyond which there is no repulsion.", default=0.5, above=0.0, room="across"
    )
    gain: Number = param("Gain of the potential.", default=100.0, above=0.0)
    saturation: Speed = param("Largest repulsion.", default=4.0, above=0.0)
    treat_as_obstacles: tuple[str, ...] | None = param(
        "The vehicles to keep away from; by default all others.",
        default=None,
        names="vehicle",
    )
    speed: Speed = param("Largest change of a velocity setpoint.", default=0.5, above=0.0)
    velocity: Speed = param("Largest speed of a shifted position.", default=1.0, above=0.0)
    acceleration: Acceleration = param(
        "Largest acceleration of a shifted position.", default=2.0, above=0.0
    )


class PotentialField(Processor[PotentialFieldParams]):
    evades = True
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }

    @classmethod
    def objections(
        cls, params: PotentialFieldParams, context: VehicleContext
    ) -> Iterator[Objection]:
        if params.farthest <= params.nearest:
            reason = f"must be greater than `nearest`, {params.nearest:g} m"
            yield Objection("farthest", reason, "write `farthest: 50 cm`")

    def __init__(self, params: PotentialFieldParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._nearby = Nearby(context, params.treat_as_obstacles)
        self._follower = Follower(context.airframe)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        p, follower = self.params, self._follower
        if p.treat_as_obstacles is not self._nearby.others:
            self._nearby.count(p.treat_as_obstacles)
        follower.resume(setpoint, tick)
        farthest = max(p.farthest, p.nearest + 1e-3)
        potential = Potential(p.level, p.above, p.nearest, farthest, p.gain, p.saturation)
        near = self._nearby.near(tick.known().position, 0.0, tick, lambda _: potential.reach)
        repelled = push(near, potential)
        asked, dt = motion_of(setpoint), tick.dt
        if repelled == ZERO and not follower.behind:
            follower.join(asked)
            return setpoint
        places = setpoint.kind is SetpointKind.POSITION
        speed = p.velocity if places else inf
        goal = follower.pursuit(asked, speed, p.acceleration, dt)
        goal = shortened(add(goal, repelled if places else shortened(repelled, p.speed)), speed)
        change = shortened(follower.change_to(goal, dt), p.acceleration)
        motion = follower.advance(change, dt)
        if repelled == ZERO and follower.has_caught_up(asked, p.acceleration, dt):
            follower.join(asked)
            return setpoint
        return motion.setpoint_like(setpoint)
