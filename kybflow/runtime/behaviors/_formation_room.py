"""What a formation's places are kept away from: the fence, the ground, obstacles, and vehicles that
are no members."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

from kybflow.core.geometry import Vec3, add, norm
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Tick, Time
from kybflow.core.units import Length
from kybflow.flight.avoidance.clearance import Surface, reach_of, stopping_speed, walls
from kybflow.world.shapes import Box, Shape, Sphere, around
from kybflow.world.vehicle_context import VehicleContext


@params
class FormationRoomParams:
    """The distances that are kept."""

    margin: Length = param(
        "Kept from the fence by every place.", default=0.3, at_least=0.0, tightens="up"
    )
    clearance: Length = param(
        "Kept between hubs and obstacles, and other vehicles, by every place.",
        default=0.3, above=0.0, tightens="up",
    )  # fmt: skip
    lowest: Length = param(
        "Least height above the ground of the start.", default=0.4, above=0.0, tightens="up"
    )


class FormationRoom:
    """Where a formation may be, as one of its members sees it."""

    def __init__(self, context: VehicleContext, team: tuple[str, ...]) -> None:
        self._context = context
        self._others = tuple(name for name in context.diameters if name not in team)

    def box(self, p: FormationRoomParams) -> Box | None:
        """Return where places may be in the fence; None without one."""
        fence, ground = self._context.fence, self._context.start[2]
        if fence is None:
            return None
        (x0, y0, z0), (x1, y1, z1), m = fence.low, fence.high, p.margin
        return Box((x0 + m, y0 + m, max(z0, ground + p.lowest)), (x1 - m, y1 - m, z1 - m))

    def centred(self, centre: Vec3, offsets: Sequence[Vec3], p: FormationRoomParams) -> Vec3:
        """Return the centre nearest to `centre` from which every offset is in the room, or is as
        little outside as it can be."""
        box = self.box(p)
        if box is None:
            return centre
        kept = []
        for axis in range(3):
            reach = [offset[axis] for offset in offsets]
            low, high = box.low[axis] - min(reach), box.high[axis] - max(reach)
            middle = 0.5 * (low + high)
            kept.append(middle if low > high else max(low, min(high, centre[axis])))
        return (kept[0], kept[1], kept[2])

    def obstacles(self, tick: Tick, delay: Time, left: Collection[str]) -> tuple[Shape, ...]:
        """Return the world's obstacles, those that move, the vehicles that are no members, and the
        members that have `left`, from what they publish."""
        shapes: list[Shape] = list(self._context.obstacles.values())
        shapes += (Sphere(seen.position, seen.radius) for seen in tick.moving.values())
        for name in (*self._others, *left):
            news = tick.neighbours.heard(name, tick.now - delay)
            if news is not None and news.estimate is not None:
                at, v, age = news.estimate.position, news.estimate.velocity, tick.now - news.time
                s = age / NS
                moved = (at[0] + v[0] * s, at[1] + v[1] * s, at[2] + v[2] * s)
                shapes.append(Sphere(moved, 0.5 * self._context.diameters.get(name, 0.0)))
        return tuple(shapes)

    def around(
        self,
        centre: Vec3,
        offsets: Sequence[Vec3],
        obstacles: tuple[Shape, ...],
        speed: float,
        p: FormationRoomParams,
    ) -> Iterator[tuple[Vec3, tuple[Surface, ...]]]:
        """Yield each offset with what a place there must slow down for at `speed` (m/s)."""
        box, keep = self.box(p), self._context.airframe.arm + p.clearance
        if not obstacles and (box is None or _is_far(centre, offsets, box, speed)):
            yield from ((offset, ()) for offset in offsets)
            return
        for offset in offsets:
            place = add(centre, offset)
            near = list(_solids(place, obstacles, keep, speed)) if obstacles else []
            if box is not None and stopping_speed(-box.outside_by(place)) < speed:
                near += (wall for wall in walls(place, box) if stopping_speed(wall.room) < speed)
            yield offset, tuple(near)


def _solids(place: Vec3, shapes: Iterable[Shape], keep: float, speed: float) -> Iterator[Surface]:
    """Yield what a place that keeps away from the shapes must slow down for at `speed` (m/s)."""
    for shape in shapes:
        for apart, outward in around(shape, place, keep + reach_of(speed)):
            room = apart - keep
            if stopping_speed(room) < speed:
                yield Surface(room, outward)


def _is_far(centre: Vec3, offsets: Sequence[Vec3], box: Box, speed: float) -> bool:
    """Whether no place has to slow down for a wall at `speed`."""
    room = -box.outside_by(centre) - max(norm(offset) for offset in offsets)
    return stopping_speed(room) >= speed
