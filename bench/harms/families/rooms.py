"""Rooms that don't have the place: obstacles on the way, fences below it, places outside."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from harms.mission_text import Edit, Mission, Node, add, put
from harms.operator import Changes, change, dangerous, senseless

Point = tuple[float, float, float]


def _legs(mission: Mission) -> Iterator[tuple[Node, Point, Point]]:
    """The straight ways that are written: the state's key, from, to."""
    for state in mission.states("fly_to", "follow_path"):
        params = mission.planned(state.vehicle).states[state.name].behavior.params
        path = list(getattr(params, "path", ()))
        if state.do == "fly_to" and _hovers_over_its_start(mission, state.vehicle):
            x, y, _ = mission.planned(state.vehicle).start
            path = [(x, y, params.position[2]), params.position]
        for first, second in pairwise(path):
            if sum((a - b) ** 2 for a, b in zip(first, second, strict=True)) > 0.8:
                yield state.key, first, second


def _hovers_over_its_start(mission: Mission, vehicle: str) -> bool:
    """Whether its only way to the side is one `fly_to`."""
    moves = [s for s in mission.states("fly_to", "follow_path", "circle") if s.vehicle == vehicle]
    return len(moves) == 1 and mission.at("flows") is None


def _obstacle(mission: Mission, shape: str) -> Edit | None:
    """The world has one more obstacle."""
    world = mission.at("world")
    if world is None:
        return None
    if world.id == "scalar":
        return put(world, f"{{like: {world.value}, obstacles: {{thing: {shape}}}}}")
    own = mission.at("obstacles", of=world)
    return add(own, f"thing: {shape}") if own else add(world, f"obstacles: {{thing: {shape}}}")


def _box(x: float, y: float, half: float, height: float) -> str:
    low, high = f"[{x - half:g}, {y - half:g}, 0]", f"[{x + half:g}, {y + half:g}, {height:g}]"
    return f"{{box: {{from: {low}, to: {high}}}}}"


def _placed(mission: Mission, shape: str, *also: Node) -> Changes:
    edit = _obstacle(mission, shape)
    if edit is not None:
        yield change(edit, also=also)


@dangerous
def obstacle_on_the_way(mission: Mission) -> Changes:
    """A crate in the middle of a leg."""
    for key, a, b in _legs(mission):
        yield from _placed(mission, _box((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, 0.1, 2.0), key)


@dangerous
def obstacle_beside_the_way(mission: Mission) -> Changes:
    """A pole whose face is 4 cm beside the middle of the way: a rotor hits it."""
    for key, a, b in _legs(mission):
        length = ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5
        if length > 0.5:
            aside = 0.09 / length
            x = (a[0] + b[0]) / 2 - (b[1] - a[1]) * aside
            y = (a[1] + b[1]) / 2 + (b[0] - a[0]) * aside
            shape = f"{{cylinder: {{at: [{x:.3f}, {y:.3f}, 0], radius: 5 cm, height: 2 m}}}}"
            yield from _placed(mission, shape, key)


@dangerous
def obstacle_on_the_circle(mission: Mission) -> Changes:
    """A pole on the line of a circle."""
    for state in mission.states("circle"):
        params = mission.planned(state.vehicle).states[state.name].behavior.params
        x, y = params.center[0] + params.radius, params.center[1]
        shape = f"{{cylinder: {{at: [{x:g}, {y:g}, 0], radius: 5 cm, height: 2 m}}}}"
        yield from _placed(mission, shape, state.key)


@dangerous
def obstacle_on_the_start(mission: Mission) -> Changes:
    """A crate where a vehicle stands."""
    for vehicle in mission.vehicles():
        x, y, _ = mission.planned(vehicle.name).start
        yield from _placed(mission, _box(x, y, 0.2, 0.5), vehicle.key)


@dangerous
def obstacle_over_the_start(mission: Mission) -> Changes:
    """A lamp 60 cm above the start, in the way of the climb."""
    for vehicle in mission.vehicles():
        x, y, _ = mission.planned(vehicle.name).start
        shape = f"{{sphere: {{at: [{x:g}, {y:g}, 0.6], radius: 10 cm}}}}"
        ups = [s.key for s in mission.states("take_off") if s.vehicle == vehicle.name]
        yield from _placed(mission, shape, vehicle.key, *ups)


@dangerous
def obstacle_on_the_landing_place(mission: Mission) -> Changes:
    """A pole half a metre high and as thick as an arm where it comes down at last."""
    for state in mission.states("fly_to"):
        place = mission.planned(state.vehicle).states[state.name].behavior.params.position
        landing = [s for s in mission.states("land") if s.vehicle == state.vehicle]
        if _hovers_over_its_start(mission, state.vehicle) and landing:
            x, y = place[:2]
            shape = f"{{cylinder: {{at: [{x:g}, {y:g}, 0], radius: 4 cm, height: 50 cm}}}}"
            yield from _placed(mission, shape, landing[-1].key, state.key)


def _starts(mission: Mission) -> list[Node]:
    return [n for v in mission.vehicles() if (n := mission.at("start", of=v.node)) is not None]


def _fence(mission: Mission) -> tuple[Node, Node] | None:
    low, high = mission.at("world", "fence", "from"), mission.at("world", "fence", "to")
    return (low, high) if low and high else None


@dangerous
def fence_below_the_way(mission: Mission) -> Changes:
    """A ceiling of 80 cm over a flight at 1 m: the fence clamps it, or the failsafe lands it."""
    fence = _fence(mission)
    if fence and mission.states("take_off"):
        ups = [s.key for s in mission.states("take_off")]
        yield change(put(fence[1].value[2], "0.8"), also=tuple(ups))


@dangerous
def fence_smaller_than_the_way(mission: Mission) -> Changes:
    """A fence of 30 cm to every side, where the vehicles fly metres."""
    fence = _fence(mission)
    moves = mission.states("circle", "figure_eight", "fly_to", "follow_path")
    if fence and moves:
        edits = put(fence[0], "[-0.3, -0.3, 0]"), put(fence[1], "[0.3, 0.3, 2.5]")
        starts = [v.key for v in mission.vehicles()]
        yield change(*edits, also=(*(s.key for s in moves), *starts, *_starts(mission)))


@dangerous
def fence_in_centimetres(mission: Mission) -> Changes:
    """`[300, 300, 250]`, meant in cm: a fence of 600 m protects nothing."""
    fence = _fence(mission)
    if fence:
        low, high = (
            ", ".join(f"{float(n.value) * 100:g}" for n in corner.value) for corner in fence
        )
        yield change(put(fence[0], f"[{low}]"), put(fence[1], f"[{high}]"))


@dangerous
def fence_above_the_floor(mission: Mission) -> Changes:
    """A fence that begins 50 cm above the floor: who stands on it is outside."""
    fence = _fence(mission)
    if fence:
        starts = [v.key for v in mission.vehicles()]
        yield change(put(fence[0].value[2], "0.5"), also=(*starts, *_starts(mission)))


@dangerous
def no_fence(mission: Mission) -> Changes:
    """The fence is gone: nothing keeps it inside the room."""
    world = mission.at("world")
    key = next((k for k, v in mission.root.value if k.value == "world"), None)
    if world is None or key is None or not mission.at("fence", of=world):
        return
    if not world.flow_style and len(world.value) == 1:
        fence = world.value[0]
        start, end = fence[0].start_mark.index, fence[1].end_mark.index
        vehicles = (v.key for v in mission.vehicles())
        yield change(Edit(start, end, "points: {}"), also=(key, *vehicles))


@dangerous
def start_outside(mission: Mission) -> Changes:
    """A start 10 m to the side, outside of the fence."""
    for vehicle in mission.vehicles():
        at = mission.at("start", "at", of=vehicle.node)
        if at is not None:
            yield change(put(at, "[10, 0, 0]"))


@dangerous
def start_in_the_air(mission: Mission) -> Changes:
    """A start 1 m above the floor, with nothing below it to stand on."""
    for vehicle in mission.vehicles():
        at = mission.at("start", "at", of=vehicle.node)
        if at is not None:
            x, y, _ = mission.planned(vehicle.name).start
            yield change(put(at, f"[{x:g}, {y:g}, 1]"))


@dangerous
def goal_outside(mission: Mission) -> Changes:
    """A goal 10 m away, outside of the fence."""
    for state in mission.states("fly_to", "circle"):
        node = mission.at("position", of=state.node) or mission.at("center", of=state.node)
        if node is not None:
            yield change(put(node, "[10, 0, 1]"))


@dangerous
def corner_outside(mission: Mission) -> Changes:
    """One corner of a path is outside of the fence."""
    for state in mission.states("follow_path"):
        path = mission.at("path", of=state.node)
        if path is not None and path.value:
            yield change(put(path.value[0], "[0.5, 9, 1]"))


@dangerous
def higher_than_the_ceiling(mission: Mission) -> Changes:
    """A take-off to 3.5 m under a ceiling of 2.5 m."""
    for state in mission.states("take_off"):
        height = mission.at("height", of=state.node)
        if height is not None:
            yield change(put(height, "3.5 m"))


@senseless
def home_above_the_ceiling(mission: Mission) -> Changes:
    """`go_home` at a height of 6 m under a ceiling of 2.5 m: it never flies there."""
    for state in mission.states("go_home"):
        height = mission.at("height", of=state.node)
        yield change(put(height, "6 m") if height else add(state.node, "height: 6 m"))


@dangerous
def home_outside(mission: Mission) -> Changes:
    """A home 10 m to the side, outside of the fence: there the failsafe flies it."""
    for vehicle in mission.own():
        yield change(add(vehicle.node, "home: [10, 0, 0]"))


@dangerous
def lands_below_the_floor(mission: Mission) -> Changes:
    """It lands on a point 1 m below the floor."""
    for state in mission.states("land"):
        if mission.at("position", of=state.node) is None:
            x, y, _ = mission.planned(state.vehicle).start
            yield change(add(state.node, f"position: [{x:g}, {y:g}, -1]"))


@senseless
def lands_in_the_air(mission: Mission) -> Changes:
    """It lands on a point 1 m above the floor, where nothing is: it comes down to the floor."""
    for state in mission.states("land"):
        if mission.at("position", of=state.node) is None:
            x, y, _ = mission.planned(state.vehicle).start
            yield change(add(state.node, f"position: [{x:g}, {y:g}, 1]"))


@dangerous
def lands_outside(mission: Mission) -> Changes:
    """It lands on a point outside of the fence."""
    for state in mission.states("land"):
        if mission.at("position", of=state.node) is None:
            yield change(add(state.node, "position: [0, 12, 0]"))


@dangerous
def eight_wider_than_the_room(mission: Mission) -> Changes:
    """An eight 20 m wide in a room of 6 m."""
    for state in mission.states("figure_eight"):
        width = mission.at("width", of=state.node)
        if width is not None:
            yield change(put(width, "20 m"))


@senseless
def point_that_nothing_uses(mission: Mission) -> Changes:
    """A point of the world is written and nothing flies there."""
    world = mission.at("world")
    if world is not None and world.id == "mapping":
        own = mission.at("points", of=world)
        yield change(
            add(own, "spare: [0, 0, 1]") if own else add(world, "points: {spare: [0, 0, 1]}")
        )
