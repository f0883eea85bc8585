"""Keep the setpoint inside the mission's fence, shrunk by a margin; fails closed.

A position outside is moved to the nearest point inside, axis by axis; on such an axis an outward
velocity, the acceleration and the jerk become zero. A velocity is limited, axis by axis, to the
speed that can still stop before the face that it approaches,

    |v| <= sqrt(2 a (d - a / (4 k^2))),    a = 1 m/s^2, d the distance of the estimate from it,

and linearly, to k d with k = 2 1/s, over the last a / (2 k^2). The deceleration that this requires
is fed forward; beyond the face the velocity leads back with at most 0.3 m/s. If the margin leaves
no room along an axis, only the middle of the fence counts as inside. A setpoint that is inside
passes unchanged, and so does every setpoint if the mission has no fence.

The floor is different, because take-off and landing cross it, and the height of the ground varies:
a position below it is allowed down to 0.5 m below the vehicle, which is enough for every landing.
World frame, metres.
"""

from __future__ import annotations

from math import sqrt
from typing import ClassVar

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import Length
from kybflow.parts import Processor, param, params
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import VehicleContext

_FLOOR_ROOM = 0.5
_DECELERATION = 1.0
_GAIN = 2.0
_RETURN_SPEED = 0.3


@params
class FenceProcessorParams:
    margin: Length = param(
        "Distance that the setpoint keeps from the fence.",
        default=0.2,
        at_least=0.0,
        tightens="up",
    )


class FenceProcessor(Processor[FenceProcessorParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }
    safety = True
    clamps = True

    def __init__(self, params: FenceProcessorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._fence = context.fence
        self._margin = params.margin
        self._room = _shrunk(context.fence, params.margin) if context.fence is not None else None

    @classmethod
    def keeps_inside(cls, params: FenceProcessorParams, fence: Box) -> Box | None:
        return _shrunk(fence, params.margin)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        if self._fence is None or self._room is None:
            return setpoint
        if self.params.margin != self._margin:
            self._margin = self.params.margin
            self._room = _shrunk(self._fence, self._margin)
        position = setpoint.position
        if position is not None and self._room.contains(position):
            return setpoint
        known = tick.known()
        x, y, floor = self._room.low
        room = Box((x, y, min(floor, known.position[2] - _FLOOR_ROOM)), self._room.high)
        if position is not None:
            return setpoint if room.contains(position) else _clamped(setpoint, position, room)
        return _stoppable(setpoint, known, room)


def _shrunk(fence: Box, margin: float) -> Box:
    """Return the fence shrunk by the margin on every side but the floor."""
    low, high = list(fence.low), list(fence.high)
    for i, below in enumerate((margin, margin, 0.0)):
        low[i], high[i] = low[i] + below, high[i] - margin
        if low[i] > high[i]:
            low[i] = high[i] = 0.5 * (fence.low[i] + fence.high[i])
    return Box(_vector(low), _vector(high))


def _clamped(setpoint: Setpoint, position: Vec3, room: Box) -> Setpoint:
    inside = [min(max(position[i], room.low[i]), room.high[i]) for i in range(3)]
    velocity = list(setpoint.velocity or ZERO)
    acceleration = list(setpoint.acceleration or ZERO)
    jerk = list(setpoint.jerk or ZERO)
    for i in range(3):
        outward = position[i] - inside[i]
        if outward != 0.0:
            velocity[i] = 0.0 if velocity[i] * outward > 0.0 else velocity[i]
            acceleration[i] = jerk[i] = 0.0
    return setpoint._replace(
        position=_vector(inside),
        velocity=_vector(velocity),
        acceleration=_vector(acceleration),
        jerk=_vector(jerk),
    )


def _stoppable(setpoint: Setpoint, known: Estimate, room: Box) -> Setpoint:
    """Return the velocity setpoint, limited on each axis to the speed that can still stop before
    the face it approaches, with the deceleration that this requires."""
    wanted = setpoint.velocity or ZERO
    velocity, acceleration, jerk = list(wanted), list(setpoint.acceleration or ZERO), list(ZERO)
    for i in range(3):
        for face, outward in ((room.high[i], 1.0), (room.low[i], -1.0)):
            allowed, steepness = _closing(outward * (face - known.position[i]))
            if outward * velocity[i] > allowed:
                velocity[i] = outward * allowed
                pull = steepness * max(outward * known.velocity[i], 0.0)
                acceleration[i] = -outward * min(pull, 2.0 * _DECELERATION)
    if _vector(velocity) == wanted:
        return setpoint
    return setpoint._replace(
        velocity=_vector(velocity), acceleration=_vector(acceleration), jerk=_vector(jerk)
    )


def _closing(left: float) -> tuple[float, float]:
    """Return the allowed speed (m/s) towards a face `left` metres away, and by how much it falls
    per metre (1/s). Beyond the face the speed is negative, so that it leads back."""
    linear = 0.5 * _DECELERATION / (_GAIN * _GAIN)
    if left <= linear:
        return max(_GAIN * left, -_RETURN_SPEED), _GAIN if left > 0.0 else 0.0
    speed = sqrt(2.0 * _DECELERATION * (left - 0.5 * linear))
    return speed, _DECELERATION / speed


def _vector(numbers: list[float]) -> Vec3:
    return (numbers[0], numbers[1], numbers[2])
