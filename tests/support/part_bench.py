"""A test bench for single parts: ticks, estimates and entries, and a vehicle that follows setpoints
ideally or as a point mass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from kybflow.core.events import Emitting
from kybflow.core.geometry import LEVEL, ZERO, Vec3, add, norm, scale, sub
from kybflow.core.signals import (
    NS,
    Battery,
    Done,
    Estimate,
    Failed,
    InputReading,
    SeenObject,
    SeenObjects,
    Setpoint,
    SetpointKind,
    Tick,
)
from kybflow.parts import AIR, AXES, Behavior, Entry, Flight
from kybflow.world.objects import ObjectSurface, SlideJoint, WorldObject
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import Airframe, VehicleContext

DT = 0.004
MASS = 0.230
AIRFRAME = Airframe(
    mass=MASS, diameter=0.19, inertia=(0.00045, 0.00045, 0.0008), thrust=1.3, rotor_time=0.03,
    drag=0.35,
)  # fmt: skip
FENCE = Box((-3.0, -3.0, 0.0), (3.0, 3.0, 2.5))
RAIL = SlideJoint((1.0, 0.0, 0.0), low=0.0, high=1.0)
BACK = ObjectSurface("back", (-0.1, 0.0, 0.0), (-1.0, 0.0, 0.0), width=0.5, height=0.3)
BLOCK = WorldObject("block", (1.0, 0.2, 1.0), (0.2, 0.2, 0.2), 1.0, joint=RAIL, surfaces=(BACK,))
SITE = VehicleContext("nano", AIRFRAME, ZERO, 0.0, FENCE, DT)
WITH_BLOCK = SITE._replace(objects={"block": BLOCK})
CENTRED = InputReading(0, dict.fromkeys(AXES, 0.0))
INPUTS = {"a": CENTRED}


def seen_block(q: float = 0.0, speed: float = 0.0, now: int = 0) -> SeenObjects:
    """The block when it was seen at `q` on its rail."""
    x, y, z = BLOCK.at
    return {"block": SeenObject(now, (x + q, y, z), LEVEL, (speed, 0.0, 0.0), q, speed)}


def estimate(
    position: Vec3, velocity: Vec3 = ZERO, now: int = 0, age: float = 0.0, spread: float = 0.001
) -> Estimate:
    return Estimate(now, position, velocity, LEVEL, ZERO, "mocap", age, spread)


def at_rest(position: Vec3, velocity: Vec3 = ZERO) -> Setpoint:
    """A setpoint of position, with a velocity if it should move."""
    return Setpoint(SetpointKind.POSITION, position, velocity, ZERO, ZERO, 0.0)


def entry(
    position: Vec3,
    velocity: Vec3 = ZERO,
    flight: Flight = AIR,
    setpoint: Setpoint | None = None,
    context: VehicleContext = SITE,
) -> Entry:
    """Entered with the vehicle on its setpoint, if not said otherwise."""
    if setpoint is None and flight is AIR:
        setpoint = at_rest(position, velocity)
    thrust = context.airframe.hover_thrust
    known = estimate(position, velocity)
    return Entry(0, context, known, setpoint, thrust, flight, inputs=INPUTS)


def tick(
    elapsed: float = 0.0,
    known: Estimate | None = None,
    setpoint: Setpoint | None = None,
    battery: Battery | None = None,
) -> Tick:
    now = round(elapsed * NS)
    fleet = {"nano": known}
    return Tick(now, DT, elapsed, known, battery, setpoint, fleet, inputs=INPUTS)


class Sample(NamedTuple):
    time: float
    setpoint: Setpoint


class Flown(NamedTuple):
    """What a behavior put out: a sample for each tick, its end, None while it went on, and the
    events that it told, each with what it carries."""

    samples: tuple[Sample, ...]
    end: Done | Failed | None
    told: tuple[tuple[object, ...], ...] = ()

    @property
    def duration(self) -> float:
        return self.samples[-1].time

    @property
    def moving(self) -> tuple[Sample, ...]:
        """Without the IDLE ones."""
        return tuple(s for s in self.samples if s.setpoint.kind is SetpointKind.POSITION)


Body = Callable[[Setpoint | None], tuple[Vec3, Vec3]]


def ideal(start: Vec3, velocity: Vec3 = ZERO) -> Body:
    """A vehicle that is always where its last setpoint was."""

    def move(setpoint: Setpoint | None) -> tuple[Vec3, Vec3]:
        if setpoint is None or setpoint.position is None:
            return start, velocity
        return setpoint.position, setpoint.velocity or ZERO

    return move


def point_mass(start: Vec3, ground: float, most: float = 8.0, push: Vec3 = ZERO) -> Body:
    """A point mass with TeleKyb's PD law (9.0, 7.5), at most `most` m/s^2, over a floor."""
    state = [start, ZERO]

    def move(setpoint: Setpoint | None) -> tuple[Vec3, Vec3]:
        position, velocity = state
        if setpoint is not None and setpoint.position is not None:
            pull = scale(sub(setpoint.position, position), 9.0)
            pull = add(pull, scale(sub(setpoint.velocity or ZERO, velocity), 7.5))
            pull = add(pull, setpoint.acceleration or ZERO)
            if norm(pull) > most:
                pull = scale(pull, most / norm(pull))
            velocity = add(velocity, scale(add(pull, push), DT))
            position = add(position, scale(velocity, DT))
        if position[2] < ground:
            position, velocity = (position[0], position[1], ground), ZERO
        state[:] = [position, velocity]
        return position, velocity

    return move


def fly(behavior: Behavior[Any], body: Body, seconds: float = 120.0) -> Flown:
    """Tick a behavior until it ends or the time is over."""
    samples: list[Sample] = []
    told: list[tuple[object, ...]] = []
    setpoint: Setpoint | None = None
    for i in range(round(seconds / DT)):
        position, velocity = body(setpoint)
        now = i * DT
        output = behavior.update(tick(now, estimate(position, velocity, round(now * NS)), setpoint))
        if isinstance(output, Emitting):
            told.append((output.event.name, *output.event.recorded().values()))
            output = output.output
        ended = isinstance(output, Done | Failed)
        setpoint = output.setpoint if ended else output
        samples.append(Sample(now, setpoint))
        if ended:
            return Flown(tuple(samples), output, tuple(told))
    return Flown(tuple(samples), None, tuple(told))


def worst_mismatch(samples: Sequence[Sample], field: str, derivative: str) -> float:
    """The largest difference between `derivative` and the central difference of `field`."""
    worst = 0.0
    for before, here, after in zip(samples, samples[1:], samples[2:], strict=False):
        slope = scale(
            sub(getattr(after.setpoint, field), getattr(before.setpoint, field)), 0.5 / DT
        )
        worst = max(worst, norm(sub(slope, getattr(here.setpoint, derivative))))
    return worst


def fastest(samples: Sequence[Sample]) -> float:
    return max(norm(s.setpoint.velocity) for s in samples)


def hardest(samples: Sequence[Sample]) -> float:
    return max(norm(s.setpoint.acceleration) for s in samples)
