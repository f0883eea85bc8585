"""The MuJoCo model of a world: floor, fence (as a faint box), obstacles, parcels and vehicles.

A vehicle's origin is its centre of mass, in the plane of its rotors. A vehicle on the floor is at
z = 0, so the floor lies `LEGS` below. The rotors form an X, in the order front left, rear left,
rear right, front right. The first and the third turn clockwise seen from above, so that their drag
turns the body counterclockwise.

MuJoCo simulates bodies and contacts, but neither actuators nor sensors, whose cost grows with the
number of actuators times that of degrees of freedom. `steps.rotors` and `sensors` compute rotors
and IMUs.

A carried parcel is a cube whose lower side is level with the legs. It adds to the vehicle's mass
and inertia (`loaded`); its own MuJoCo body is weightless, touches nothing and follows the vehicle.
A released parcel is a separate box. It starts with the velocity that it had on board, v + w x r,
while the vehicle keeps its own. It collides with the floor, obstacles and other parcels at once. It
collides with vehicles only when it is clear of its carrier, since a box released on the ground lies
between the legs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import cos, sin, sqrt
from typing import Any, NamedTuple

from kybflow.core.geometry import Vec3, add, cross, distance, norm, rotate
from kybflow.world.shapes import (
    Box,
    Convex,
    Cylinder,
    MovingSphere,
    Plane,
    Scanned,
    Sphere,
    parts_of,
)
from kybflow.world.vehicle_context import LEGS, Parcel, VehicleContext

FIRST_BODY = 1
"""Number of the first vehicle's MuJoCo body. Everything that doesn't move belongs to body 0."""
FLOOR = "floor"
"""Name of the floor's geom."""
OBSTACLE = "obstacle "
"""Prefix of the names of obstacles' geoms."""
PARCEL = "payload "
"""Prefix of the names of parcels' geoms."""
OBJECT = "object "
"""Prefix of the names of objects' bodies, joints and geoms."""
BUMPER_HEIGHT = 0.03
"""Height of a bumper's edge, m."""
_SCANNED = 'rgba="0.6 0.45 0.35 1"'
SOLID = '<default><geom conaffinity="3"/></default>\n'
"""Collision defaults if there are parcels: everything except vehicles collides with all parcels,
and a vehicle with those parcels that are clear of their carrier."""


class BuiltAirframe(NamedTuple):
    """A vehicle as built, which differs from its nominal airframe. SI units. thrust: largest thrust
    of each rotor."""

    mass: float
    inertia: Vec3
    thrust: tuple[float, float, float, float]
    rotor_time: float
    drag: float


def world_text(
    contexts: Sequence[VehicleContext],
    bodies: Sequence[BuiltAirframe],
    timestep: float,
    objects: str = "",
) -> str:
    """Return the world as MJCF. bodies: the vehicles as built. timestep: seconds. objects: the
    objects as MJCF; they follow the vehicles and parcels, whose joints are found by their
    places."""
    every = enumerate(zip(contexts, bodies, strict=True))
    vehicles = "".join(_vehicle(index, context, body) for index, (context, body) in every)
    fences = {context.fence: None for context in contexts if context.fence is not None}
    obstacles = {name: shape for context in contexts for name, shape in context.obstacles.items()}
    moving = {name: ball for context in contexts for name, ball in context.moving.items()}
    carrying = [context for context in contexts if context.payload is not None]
    return f"""<mujoco model="kybflow">
<option timestep="{timestep!r}" gravity="0 0 -9.81" integrator="Euler"/>
{SOLID if carrying else ""}<visual><headlight ambient="0.4 0.4 0.4" diffuse="0.4 0.4 0.4"/></visual>
<asset>
<texture name="tiles" type="2d" builtin="checker" rgb1="0.72 0.74 0.77" rgb2="0.62 0.64 0.68"
 width="256" height="256"/>
<material name="tiles" texture="tiles" texrepeat="1 1" texuniform="true"/>
</asset>
<worldbody>
<light pos="0 0 6" dir="0 0 -1" directional="true" castshadow="false" diffuse="0.6 0.6 0.6"/>
<geom name="{FLOOR}" type="plane" size="0 0 1" pos="0 0 {-LEGS}" material="tiles"/>
{"".join(_fence(box) for box in fences)}
{"".join(_obstacle(n, s) for n, s in obstacles.items() if not isinstance(s, Scanned))}
{vehicles}{"".join(parcel_text(context) for context in carrying)}{objects}
{"".join(_moving(name, ball) for name, ball in moving.items())}
{"".join(_scanned(n, s) for n, s in obstacles.items() if isinstance(s, Scanned))}
</worldbody>
</mujoco>"""


def _fence(box: Box) -> str:
    middle = numbers((low + high) / 2 for low, high in zip(box.low, box.high, strict=True))
    half = numbers((high - low) / 2 for low, high in zip(box.low, box.high, strict=True))
    return (
        f'<geom type="box" pos="{middle}" size="{half}" rgba="0.2 0.5 1 0.06"'
        ' contype="0" conaffinity="0" group="1"/>\n'
    )


def _scanned(name: str, shape: Scanned) -> str:
    """Return an obstacle of several parts as a body without joints. Contacts report the body's name
    for all its parts."""
    parts = "".join(f"<geom {_place(part)} {_SCANNED}/>\n" for part in parts_of(shape))
    return f'<body name="{escape(OBSTACLE + name)}">\n{parts}</body>\n'


def _obstacle(name: str, shape: Convex) -> str:
    return f'<geom name="{escape(OBSTACLE + name)}" {_place(shape)} rgba="0.6 0.45 0.35 0.8"/>\n'


def _place(shape: Convex) -> str:
    match shape:
        case Box(low, high):
            middle = tuple((a + b) / 2 for a, b in zip(low, high, strict=True))
            return _geom("box", middle, ((b - a) / 2 for a, b in zip(low, high, strict=True)))
        case Cylinder((x, y, z), radius, height):
            return _geom("cylinder", (x, y, z + height / 2), (radius, height / 2))
        case Sphere(at, radius):
            return _geom("sphere", at, (radius,))
        case Plane(at, facing):
            return f'{_geom("plane", at, (0.0, 0.0, 1.0))} zaxis="{numbers(facing)}"'


def _moving(name: str, ball: MovingSphere) -> str:
    """Return a moving obstacle as MJCF, as a body whose position the world sets each tick
    (`mocap`), so that contacts don't move it."""
    called = escape(OBSTACLE + name)
    return (
        f'<body name="{called}" mocap="true" pos="{numbers(ball.at(0.0))}">'
        f'<geom name="{called}" type="sphere" size="{ball.radius!r}" rgba="0.8 0.2 0.2 0.9"/>'
        "</body>\n"
    )


def _geom(kind: str, at: Iterable[float], size: Iterable[float]) -> str:
    return f'type="{kind}" pos="{numbers(at)}" size="{numbers(size)}"'


def _vehicle(index: int, context: VehicleContext, body: BuiltAirframe) -> str:
    x, y, z = context.start
    half, radius = context.airframe.arm / sqrt(2.0), context.airframe.rotor_radius
    hue = ("0.9 0.4 0.1", "0.1 0.5 0.8", "0.2 0.7 0.3", "0.7 0.2 0.6")[index % 4]
    rotors = "".join(
        f'<site pos="{sx * half:.9g} {sy * half:.9g} 0" type="cylinder"'
        f' size="{radius:.6g} 0.003" rgba="{hue} 0.5"/>'
        for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    )
    stand = _stand(context) if z > 0.0 else ""
    turn = f"{cos(context.heading / 2)!r} 0 0 {sin(context.heading / 2)!r}"
    name = escape(f"vehicle {context.vehicle}")
    mass, inertia, height = loaded(body.mass, body.inertia, context.payload)
    return f"""{stand}<body name="{name}" pos="{x!r} {y!r} {z!r}" quat="{turn}">
<freejoint/>
<inertial pos="0 0 {height!r}" mass="{mass!r}" diaginertia="{numbers(inertia)}"/>
<geom type="box" size="{half:.9g} {half:.9g} {LEGS / 2}" pos="0 0 {-LEGS / 2}" rgba="{hue} 1"
 conaffinity="1"/>
{_bumper(context, hue)}{rotors}
</body>
"""


def _bumper(context: VehicleContext, hue: str) -> str:
    """Return the round bumper of a vehicle, as MJCF."""
    radius, height = context.airframe.bumper, context.airframe.bumper_height or 0.0
    if radius is None:
        return ""
    size, at = numbers((radius, 0.5 * BUMPER_HEIGHT)), numbers((0.0, 0.0, height))
    return (
        f'<geom type="cylinder" size="{size}" pos="{at}" rgba="{hue} 0.3" conaffinity="1"'
        ' friction="0 0 0"/>\n'
    )


def mount(parcel: Parcel) -> float:
    """Return the height of a carried parcel's centre in the body frame."""
    return 0.5 * parcel.size - LEGS


def loaded(mass: float, inertia: Vec3, parcel: Parcel | None) -> tuple[float, Vec3, float]:
    """Return the mass of a vehicle with a parcel, its moments of inertia about the common centre of
    mass, and the height of that centre in the body frame. The parallel axis theorem applies with
    the reduced mass m M / (m + M); the cube itself adds m s^2 / 6. SI units."""
    if parcel is None:
        return mass, inertia, 0.0
    m, height = parcel.mass, mount(parcel)
    own, off = m * parcel.size**2 / 6.0, m * mass / (m + mass) * height**2
    jx, jy, jz = inertia
    return mass + m, (jx + own + off, jy + own + off, jz + own), m * height / (m + mass)


def parcel_text(context: VehicleContext) -> str:
    """Return a vehicle's parcel as MJCF, at its position on board."""
    assert context.payload is not None
    (x, y, z), half = context.start, 0.5 * context.payload.size
    name = escape(PARCEL + context.vehicle)
    return f"""<body name="{name}" pos="{x!r} {y!r} {z + mount(context.payload)!r}" gravcomp="1">
<freejoint/>
<geom name="{name}" type="box" size="{half!r} {half!r} {half!r}" mass="{context.payload.mass!r}"
 contype="0" conaffinity="0" rgba="0.75 0.6 0.4 1"/>
</body>
"""


def _stand(context: VehicleContext) -> str:
    """Return the stand below a vehicle that starts above the floor, as MJCF."""
    x, y, z = context.start
    half = context.airframe.arm
    return (
        f'<geom type="box" pos="{x!r} {y!r} {z / 2 - LEGS!r}" size="{half!r} {half!r} {z / 2!r}"'
        ' rgba="0.5 0.5 0.5 1"/>\n'
    )


def numbers(values: Iterable[float]) -> str:
    """Return numbers as MJCF."""
    return " ".join(repr(value) for value in values)


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
