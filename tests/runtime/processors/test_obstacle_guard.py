"""obstacle_guard: what keeps clear passes bit for bit; a pillar and a wall are stopped at."""

import pytest
from part_bench import DT, SITE, at_rest, estimate, tick

from kybflow.core.events import Emitting
from kybflow.core.geometry import ZERO, Vec3, add, distance, norm, scale
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.runtime.processors.obstacle_guard import ObstacleGuard, ObstacleGuardParams
from kybflow.world.objects import WORLD, WorldObject, distance_to
from kybflow.world.scanned import PointCloud
from kybflow.world.shapes import Box, Cylinder, Plane

PILLAR = Cylinder((1.0, 0.0, 0.0), 0.2, 2.5)
PLACE = SITE._replace(obstacles={"pillar": PILLAR})
KEPT = SITE.airframe.hull + 0.1
EAST = (0.8, 0.0, 0.0)


def moving(velocity: Vec3, position: Vec3 | None = None) -> Setpoint:
    kind = SetpointKind.VELOCITY if position is None else SetpointKind.POSITION
    return Setpoint(kind, position, velocity, ZERO, ZERO, 0.0)


def pushed(context, kind: SetpointKind, velocity: Vec3, seconds: float = 6.0) -> list[Vec3]:
    """Where a vehicle goes that follows at once."""
    guard, place, way = ObstacleGuard(ObstacleGuardParams(), context), (0.0, 0.0, 1.0), []
    asked, last, speed = place, None, ZERO
    for i in range(round(seconds / DT)):
        asked = add(asked, scale(velocity, DT))
        setpoint = moving(velocity, asked if kind is SetpointKind.POSITION else None)
        if kind is SetpointKind.ACCELERATION:
            setpoint = Setpoint(kind, acceleration=velocity, heading=0.0)
        given = guard(setpoint, tick(i * DT, estimate(place, speed), last))
        last = given.output if isinstance(given, Emitting) else given
        if kind is SetpointKind.ACCELERATION:
            speed = add(speed, scale(last.acceleration or ZERO, DT))
        else:
            speed = last.velocity or ZERO
        place = last.position or add(place, scale(speed, DT))
        way.append(place)
    return way


KINDS = (SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION)


@pytest.mark.parametrize("kind", KINDS)
def test_it_stops_before_a_pillar(kind: SetpointKind) -> None:
    way = pushed(PLACE, kind, EAST)
    assert min(PILLAR.distance(p) for p in way) > KEPT - 5e-3
    assert PILLAR.distance(way[-1]) < KEPT + 0.05
    assert abs(way[-1][1]) < 0.01
    assert norm(scale(add(way[-1], scale(way[-2], -1.0)), 1.0 / DT)) < 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_it_stops_before_an_object(kind: SetpointKind) -> None:
    crate = WorldObject("crate", (1.0, 0.0, 1.0), (0.4, 0.4, 0.4), 1.0, heading=0.3)
    way = pushed(SITE._replace(objects={"crate": crate}), kind, EAST)
    rooms = [distance_to(crate, crate.placed(WORLD, 0.0), p) for p in way]
    assert min(rooms) > KEPT - 5e-3
    assert rooms[-1] < KEPT + 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_it_slides_along_a_wall(kind: SetpointKind) -> None:
    wall = Plane((0.0, 0.5, 0.0), (0.0, -1.0, 0.0))
    way = pushed(SITE._replace(obstacles={"wall": wall}), kind, (0.4, 0.1, 0.0), 6.0)
    assert min(wall.distance(p) for p in way) > KEPT - 5e-3
    assert way[-1][0] > 1.4


@pytest.mark.parametrize("kind", KINDS)
def test_it_gets_stuck_in_no_corner(kind: SetpointKind) -> None:
    corner = {
        "east": Box((0.8, -3.0, 0.0), (1.0, 3.0, 2.5)),
        "north": Box((-3.0, 0.6, 0.0), (3.0, 1.0, 2.5)),
    }
    way = pushed(SITE._replace(obstacles=corner), kind, (0.5, 0.5, 0.0))
    for shape in corner.values():
        assert min(shape.distance(p) for p in way) > KEPT - 5e-3


def scanned(shape: Box | Cylinder, spacing: float = 0.06) -> list[Vec3]:
    """What a scanner sees of a shape around the height of 1 m."""
    steps = [spacing * k for k in range(-16, 17)]
    near = (
        (x, y, 1.0 + z) for x in [*steps, *(s + 0.96 for s in steps)] for y in steps for z in steps
    )
    return [p for p in near if abs(shape.distance(p)) < 0.5 * spacing]


@pytest.mark.parametrize("kind", KINDS)
def test_it_stops_before_a_scanned_pillar(kind: SetpointKind) -> None:
    scan = PointCloud(tuple(scanned(PILLAR)), 0.05)
    way = pushed(SITE._replace(obstacles={"scan": scan}), kind, EAST)
    assert min(scan.distance(p) for p in way) > KEPT - 1e-2
    assert scan.distance(way[-1]) < KEPT + 0.1


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_it_sees_both_walls_of_a_scanned_corner(kind: SetpointKind) -> None:
    """Fast along one, near it: of the other it knows before that is the nearer one."""
    walls = Box((0.9, -1.0, 0.0), (1.5, 1.0, 2.5)), Box((-1.0, 0.36, 0.0), (1.5, 0.9, 2.5))
    scan = PointCloud(tuple(p for wall in walls for p in scanned(wall)), 0.05)
    way = pushed(SITE._replace(obstacles={"scan": scan}), kind, (0.9, 0.05, 0.0))
    assert min(scan.distance(p) for p in way) > KEPT - 1e-2


def test_what_keeps_clear_passes_bit_for_bit() -> None:
    guard = ObstacleGuard(ObstacleGuardParams(), PLACE)
    for i in range(1000):
        place = (0.0, -2.0 + 4.0 * i / 1000, 1.0)
        setpoint = moving((0.0, 1.0, 0.0), place)
        assert guard(setpoint, tick(i * DT, estimate(place))) is setpoint


def test_what_goes_back_is_caught_up_with() -> None:
    guard, far, last = ObstacleGuard(ObstacleGuardParams(), PLACE), at_rest((0.0, 0.0, 1.0)), None
    asked = [moving(EAST, (0.8 * i * DT, 0.0, 1.0)) for i in range(300)] + [far] * 1500
    for i, setpoint in enumerate(asked):
        known = estimate((last or far).position or ZERO)
        last = guard(setpoint, tick(i * DT, known, last))
    assert last is far


def test_where_there_is_nothing_it_is_not_called() -> None:
    assert ObstacleGuard(ObstacleGuardParams(), SITE).idle
    assert not ObstacleGuard(ObstacleGuardParams(), PLACE).idle
    touchable = PLACE._replace(touchable=frozenset({"pillar"}))
    assert ObstacleGuard(ObstacleGuardParams(), touchable).idle


def test_between_what_closes_in_it_brakes_and_says_so_once() -> None:
    both = {
        "west": Box((-1.0, -1.0, 0.0), (-0.05, 1.0, 2.0)),
        "east": Box((0.05, -1.0, 0.0), (1.0, 1.0, 2.0)),
    }
    guard, place = (
        ObstacleGuard(ObstacleGuardParams(), SITE._replace(obstacles=both)),
        (0.0, 0.0, 1.0),
    )
    answers = [guard(at_rest(place), tick(i * DT, estimate(place))) for i in range(100)]
    told = [a for a in answers if isinstance(a, Emitting)]
    assert [emitting.event.name for emitting in told] == ["avoidance_blocked"]
    assert all(
        distance(a.position or ZERO, place) < 1e-9 for a in answers if isinstance(a, Setpoint)
    )


def test_a_setpoint_that_jumps_into_a_pillar_stops_before_it() -> None:
    guard, last = ObstacleGuard(ObstacleGuardParams(), PLACE), at_rest((-1.5, 0.0, 1.0))
    inside = at_rest((1.0, 0.0, 1.0))
    for i in range(1500):
        last = guard(inside if i else last, tick(i * DT, estimate(last.position), last))
        assert PILLAR.distance(last.position) > KEPT - 5e-3
    assert PILLAR.distance(last.position) < KEPT + 0.05
