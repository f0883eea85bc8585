"""Keeping away: distances that keep nothing, processors that are gone or in the wrong order,
obstacles that move into the vehicles, and scans in another unit."""

from __future__ import annotations

from collections.abc import Iterator

import yaml

from harms.mission_text import Edit, Mission, Node, Vehicle, add, add_last, drop, put
from harms.operator import Changes, change, dangerous, senseless

AVOID = "avoid_obstacles"


def avoiding(mission: Mission) -> Iterator[tuple[Vehicle, Node, Node]]:
    """Vehicles with a list of processors, the list, and its `avoid_obstacles`."""
    for vehicle in mission.own():
        for item in mission.items("processors", of=vehicle.node):
            if mission.word("use", of=item) == AVOID:
                yield vehicle, mission.at("processors", of=vehicle.node) or item, item


def tuned(mission: Mission, key: str, text: str) -> Changes:
    """`avoid_obstacles` with another value of a parameter."""
    for _, _, use in avoiding(mission):
        own = mission.at(key, of=use)
        yield change(put(own, text) if own else add_last(use, f"{key}: {text}"), also=(use,))


def _dropped(mission: Mission, processors: Node, use: Node) -> Edit:
    items = processors.value
    if processors.flow_style:
        return Edit(use.start_mark.index, items[items.index(use) + 1].start_mark.index, "")
    start = mission.text.rfind("\n", 0, use.start_mark.index) + 1
    return Edit(start, mission.text.find("\n", use.end_mark.index) + 1, "")


def _moves(mission: Mission, vehicle: str) -> tuple[Node, ...]:
    return tuple(
        s.key for s in mission.states("fly_to", "steer", "follow_path") if s.vehicle == vehicle
    )


@dangerous
def hardly_any_distance_kept(mission: Mission) -> Changes:
    """It keeps 2 mm between the rotors, less than any vehicle is off its setpoint."""
    yield from tuned(mission, "keep", "2 mm")


@senseless
def keeps_metres_for_centimetres(mission: Mission) -> Changes:
    """It keeps 20 m, cm in mind, in a room of 6 m: nobody can go anywhere."""
    yield from tuned(mission, "keep", "20 m")


@dangerous
def nobody_avoids(mission: Mission) -> Changes:
    """`avoid_obstacles` is gone from the list, and no guard is in it either."""
    for vehicle, processors, use in avoiding(mission):
        edit = _dropped(mission, processors, use)
        yield change(edit, also=(processors, *_moves(mission, vehicle.name)))


@dangerous
def avoids_before_the_limits(mission: Mission) -> Changes:
    """The limits of speed and acceleration come last, and hold back the evasions."""
    for _, processors, use in avoiding(mission):
        first = processors.value[0]
        text = mission.text[use.start_mark.index : use.end_mark.index]
        moved = f"{text}\n{' ' * (first.start_mark.column - 2)}- "
        start = first.start_mark.index
        yield change(Edit(start, start, moved), _dropped(mission, processors, use), also=(first,))


@dangerous
def pushes_in_place_of_keeping(mission: Mission) -> Changes:
    """`potential_field`, which guarantees nothing, where eight meet or a wall is."""
    for _, _, use in avoiding(mission):
        yield change(put(use, "potential_field"))


@dangerous
def keeps_from_one_alone(mission: Mission) -> Changes:
    """`treat_as_obstacles` names one vehicle; the others are none to it."""
    if len(mission.plan.vehicles) > 2:
        yield from tuned(mission, "treat_as_obstacles", f"[{mission.plan.vehicles[1].name}]")


@dangerous
def keeps_from_itself_alone(mission: Mission) -> Changes:
    """`treat_as_obstacles` names the vehicle itself, and so nobody."""
    for vehicle, _, use in avoiding(mission):
        if len(mission.plan.vehicles) > 1:
            yield change(add_last(use, f"treat_as_obstacles: [{vehicle.name}]"))


@senseless
def no_patience_for_the_way_round(mission: Mission) -> Changes:
    """It gives up half a second after it should have been there, in the middle of the detour."""
    for state in mission.states("fly_to"):
        patience = mission.at("patience", of=state.node)
        if patience is not None:
            yield change(put(patience, "500 ms"), also=(state.key,))


@senseless
def catches_up_at_a_crawl(mission: Mission) -> Changes:
    """What was kept back goes on with 5 mm/s."""
    yield from tuned(mission, "speed", "5 mm/s")


@dangerous
def goes_round_without_a_fence(mission: Mission) -> Changes:
    """The fence is gone: a detour may lead anywhere."""
    world = mission.at("world")
    if world is not None and any(avoiding(mission)) and len(world.value) > 1:
        yield change(drop(mission, world, "fence"), also=(world,))


def _obstacles(mission: Mission, *shapes: str) -> Iterator[tuple[Node, Node, str, Node]]:
    """Name, entry, shape and parameters of the obstacles that the mission's own text has."""
    for name, entry in mission.pairs("world", "obstacles"):
        for shape, params in mission.pairs(of=entry):
            if shape.value in shapes:
                yield name, entry, shape.value, params


@dangerous
def a_wall_that_may_be_touched(mission: Mission) -> Changes:
    """`contact: allowed` at a wall or a pillar: nothing keeps away from it any more."""
    for name, entry, _, _ in _obstacles(mission, "plane", "box", "cylinder", "point_cloud"):
        yield change(add_last(entry, "contact: allowed"), also=(name,))


def with_ball(mission: Mission, along: str, speed: str, *also: Node) -> Changes:
    """The world has a ball that moves."""
    world = mission.at("world")
    if isinstance(world, yaml.MappingNode):
        shape = f"thrown: {{moving_sphere: {{along: {along}, radius: 15 cm, speed: {speed}}}}}"
        own = mission.at("obstacles", of=world)
        yield change(add(own, shape) if own else add(world, f"obstacles: {{{shape}}}"), also=also)


@dangerous
def a_ball_from_where_one_starts(mission: Mission) -> Changes:
    """A moving ball begins where a vehicle stands."""
    for vehicle in mission.vehicles():
        x, y, z = mission.planned(vehicle.name).start
        along = f"[[{x:g}, {y:g}, {z + 0.1:g}], [{x + 0.5:g}, {y:g}, {z + 0.6:g}]]"
        yield from with_ball(mission, along, "30 cm/s", vehicle.key)


@dangerous
def a_ball_over_the_start(mission: Mission) -> Changes:
    """A ball goes to and fro 60 cm above where a vehicle takes off, which looks at nothing then."""
    for vehicle in mission.vehicles():
        x, y, z = mission.planned(vehicle.name).start
        low, high = f"[{x - 0.4:g}, {y:g}, {z + 0.6:g}]", f"[{x + 0.4:g}, {y:g}, {z + 0.6:g}]"
        ups = tuple(s.key for s in mission.states("take_off") if s.vehicle == vehicle.name)
        yield from with_ball(mission, f"[{low}, {high}]", "30 cm/s", vehicle.key, *ups)


@dangerous
def a_ball_faster_than_anybody(mission: Mission) -> Changes:
    """A ball of 60 m/s, cm/s in mind: nobody can get out of its way."""
    for name, _, _, params in _obstacles(mission, "moving_sphere"):
        speed = mission.at("speed", of=params)
        if speed is not None:
            yield change(put(speed, "60 m/s"), also=(name,))


@senseless
def a_ball_that_stays(mission: Mission) -> Changes:
    """A ball that moves from a point to the same point."""
    for name, _, _, params in _obstacles(mission, "moving_sphere"):
        along = mission.at("along", of=params)
        if along is not None:
            first = mission.text[along.value[0].start_mark.index : along.value[0].end_mark.index]
            yield change(put(along, f"[{first}, {first}]"), also=(name,))


def _scans(mission: Mission) -> Iterator[tuple[Node, Node]]:
    return ((name, params) for name, _, _, params in _obstacles(mission, "point_cloud"))


@dangerous
def scan_in_another_unit(mission: Mission) -> Changes:
    """A scan in metres that is taken for millimetres: the heap shrinks to a crumb."""
    for name, params in _scans(mission):
        yield change(add_last(params, "units: mm"), also=(name,))


@dangerous
def scan_with_another_origin(mission: Mission) -> Changes:
    """The scan lies 30 m to the east of the room."""
    for name, params in _scans(mission):
        yield change(add_last(params, "at: [30, 0, 0]"), also=(name,))


@dangerous
def scan_of_grains(mission: Mission) -> Changes:
    """Points with a radius of 8 mm, cm in mind, in a scan that has one every 10 cm: a vehicle goes
    through between them."""
    for name, params in _scans(mission):
        radius = mission.at("radius", of=params)
        if radius is not None:
            yield change(put(radius, "8 mm"), also=(name,))


@dangerous
def scan_without_what_stands(mission: Mission) -> Changes:
    """Everything of the scan that is lower than 5 m is left out, cm in mind."""
    for name, params in _scans(mission):
        above = mission.at("above", of=params)
        if above is not None:
            yield change(put(above, "5 m"), also=(name,))


@senseless
def scan_that_fills_the_room(mission: Mission) -> Changes:
    """Points with a radius of 8 m, cm in mind: there is no room left to fly in."""
    for name, params in _scans(mission):
        radius = mission.at("radius", of=params)
        if radius is not None:
            yield change(put(radius, "8 m"), also=(name,))


@dangerous
def steers_with_no_clearance(mission: Mission) -> Changes:
    """`clearance: 0` where a person steers into everything, and no guard behind it."""
    bare = "processors: [limit_speed, limit_acceleration, fence, position_error]"
    for state in mission.states("steer"):
        own, vehicle = mission.at("clearance", of=state.node), mission.at("vehicles", state.vehicle)
        if own is not None and vehicle is not None and not mission.at("processors", of=vehicle):
            yield change(put(own, "0 cm"), add(vehicle, bare), also=(state.key,))
