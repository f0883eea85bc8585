"""What a flight lab's members get wrong, and right, who have read the documentation only."""

from __future__ import annotations

import re
from collections.abc import Iterator

import yaml

from harms.mission_text import (
    Edit,
    Mission,
    Node,
    Vehicle,
    add,
    add_last,
    append,
    drop,
    own_list,
    own_section,
    put,
    with_key,
)
from harms.operator import Changes, change, dangerous, senseless, valid

SIDEWAYS = ("fly_to", "follow_path", "circle", "figure_eight", "follow_trajectory")
HEALTHY = "healthy: age < 250 ms and spread < 5 cm, recover_after: 1 s"
DEAD_RECKONING = "{use: inertial, healthy: spread < 30 cm, for_at_most: 3 s}"


def _first(mission: Mission) -> list[Vehicle]:
    """The first vehicle that flies by motion capture; more would repeat the change."""
    by_mocap = (v for v in mission.own() if mission.word("like", of=v.node).startswith("std."))
    return list(by_mocap)[:1]


def _alone(mission: Mission) -> list[Vehicle]:
    """The first vehicle of a mission that has no flows."""
    return [] if mission.at("flows") else _first(mission)


def _named(mission: Mission) -> list[Vehicle]:
    """The first vehicle, unless its name is that of a group."""
    return [v for v in _first(mission) if not mission.at("count", of=v.node)]


def _has(mission: Mission, vehicle: Vehicle, *parts: str) -> bool:
    return any(state.vehicle == vehicle.name for state in mission.states(*parts))


def _given(mission: Mission, mapping: Node, key: str, text: str) -> Edit:
    """A mapping has `key: text`, whether it had the key or not."""
    node = mission.at(key, of=mapping)
    return put(node, text) if node else add(mapping, f"{key}: {text}")


def _states(mission: Mission, key: str, text: str, *parts: str) -> Changes:
    """Each state of these parts has `key: text`."""
    for state in mission.states(*parts):
        yield change(with_key(mission, state.node, key, text), also=(state.key,))


def _top(mission: Mission, key: str, text: str) -> Edit:
    """The mission has `key: text`."""
    node = mission.at(key)
    if node:
        return put(node, text)
    start = next(name for name, _ in mission.root.value if name.value == "vehicles").start_mark
    return Edit(start.index, start.index, f"{key}: {text}\n\n")


def _estimators(mission: Mission, *entries: str) -> Changes:
    """The first vehicle has these estimators instead of its own or the default's."""
    for vehicle in _first(mission):
        node = mission.at("estimators", of=vehicle.node)
        if isinstance(node, yaml.SequenceNode) and not node.flow_style:
            edits = [put(old, new) for old, new in zip(node.value, entries, strict=False)]
            edits += [append(node, entry) for entry in entries[len(node.value) :]]
            edits += [
                Edit(
                    mission.text.rfind("\n", 0, old.start_mark.index),
                    old.end_mark.index,
                    "",
                )
                for old in node.value[len(entries) :]
            ]
            yield change(*edits)
        else:
            yield change(_given(mission, vehicle.node, "estimators", f"[{', '.join(entries)}]"))


def _tracker(mission: Mission, text: str, *parts: str) -> Changes:
    for vehicle in _first(mission):
        if not parts or _has(mission, vehicle, *parts):
            yield change(_given(mission, vehicle.node, "tracker", text))


def _processors(mission: Mission, *parts: str, **other: str) -> Changes:
    """The first vehicle without its own list has the default's, with some entries replaced."""
    names = ("limit_speed", "limit_acceleration", "obstacle_guard", "fence", "position_error")
    entries = ", ".join(other.get(name, name) for name in names)
    for vehicle in _first(mission):
        has_own = mission.at("processors", of=vehicle.node)
        if not has_own and (not parts or _has(mission, vehicle, *parts)):
            yield change(add(vehicle.node, f"processors: [{entries}]"))


def _avoiding(mission: Mission) -> Iterator[tuple[Vehicle, list[Node]]]:
    """The vehicles that go round others, and the entries of their processors."""
    for vehicle in mission.own():
        entries = mission.items("processors", of=vehicle.node)
        if [mission.word("use", of=e) for e in entries].count("avoid_obstacles"):
            yield vehicle, entries


def _avoidance(mission: Mission, parameters: str) -> Changes:
    for vehicle, entries in _avoiding(mission):
        one = next(e for e in entries if mission.word("use", of=e) == "avoid_obstacles")
        yield change(put(one, f"{{use: avoid_obstacles, {parameters}}}"), also=(vehicle.key,))


def _supervisors(mission: Mission, entry: str, *parts: str) -> Changes:
    """The first vehicle has one more supervisor, and keeps those that it lists or inherits."""
    for vehicle in _first(mission):
        node = mission.at("supervisors", of=vehicle.node)
        is_ardrone = "ardrone" in mission.word("like", of=vehicle.node)
        is_stack = isinstance(node, yaml.SequenceNode) and node.flow_style
        if is_stack or (parts and not _has(mission, vehicle, *parts)):
            continue
        inherited = "{use: link, age: 1.5 s}, " if is_ardrone else ""
        new = f"supervisors: [{inherited}{entry}]"
        yield change(append(node, entry) if node else add(vehicle.node, new))


def _in_simulation(mission: Mission, parameters: str, *, tags: bool = False) -> Changes:
    """The simulator has more parameters; `tags`: also where vehicles don't need mocap."""
    driver = mission.at("targets", "sim", "all", "driver")
    if not tags and not _first(mission):
        return
    if driver:
        yield change(add_last(driver, parameters))
    elif not mission.at("targets", "sim"):
        entry = f"sim: {{all: {{driver: {{use: sim, {parameters}}}}}}}"
        yield change(own_section(mission, "targets", entry))


def _target(mission: Mission, name: str, entry: str) -> Changes:
    """A mission without faults flies on a target of its own, for which it is compiled."""
    is_free = not mission.at("faults") and not mission.at("targets", name)
    if is_free and _first(mission) and "ardrone" not in mission.name:
        yield change(own_section(mission, "targets", f"{name}: {entry}"), target=name)


def _airframe(mission: Mission, numbers: str) -> Changes:
    """The first vehicle has an airframe that differs from its library's in some numbers."""
    for vehicle in _first(mission):
        like = mission.word("like", of=vehicle.node)
        yield change(
            own_section(mission, "airframes", f"ours: {{like: {like}, {numbers}}}"),
            add(vehicle.node, "airframe: ours"),
        )


def _on(mission: Mission, event: str, *actions: str, keys: str = "") -> Edit:
    return own_list(mission, "on", f"{{event: {event}, {keys}do: [{', '.join(actions)}]}}")


def _once_up(mission: Mission, *actions: str) -> Changes:
    """A callback acts when the first vehicle has taken off; VEHICLE stands for its name."""
    for vehicle in _named(mission):
        named = [action.replace("VEHICLE", vehicle.name) for action in actions]
        yield change(_on(mission, f"{vehicle.name}.took_off", *named))


def _has_own_room(mission: Mission) -> bool:
    return mission.at("world", "fence") is not None


def _numbers(mission: Mission, *keys: str, of: Node | None = None) -> list[float]:
    """A vector as it is written; empty if any of it is no number."""
    quantities = [mission.quantity(item) for item in mission.items(*keys, of=of)]
    found = [quantity.number for quantity in quantities if quantity is not None]
    return found if len(found) == len(quantities) == 3 else []


def _obstacle(mission: Mission, entry: str) -> Edit:
    world, obstacles = mission.at("world"), mission.at("world", "obstacles")
    assert world is not None
    return add(obstacles, entry) if obstacles else add(world, f"obstacles: {{{entry}}}")


def _object(mission: Mission, entry: str) -> Edit:
    objects, world = mission.at("world", "objects"), mission.at("world")
    assert world is not None
    if objects is not None:
        return add(objects, entry)
    return add(world, f"objects: {{{entry}}}")


def _free_corner(mission: Mission) -> list[float]:
    """The upper north-east corner of a room in which nobody steers and no obstacle stands."""
    is_free = not mission.at("inputs") and not mission.at("world", "obstacles")
    return _numbers(mission, "world", "fence", "to") if is_free else []


# Where vehicles stand


@dangerous
def grid_of_starts_closer_than_the_rotors(mission: Mission) -> Changes:
    """The rotors of neighbours on the grid overlap, since it is denser than an airframe."""
    for vehicle in mission.own():
        starts = mission.at("starts", of=vehicle.node)
        if starts:
            yield change(put(starts, "{grid: {at: [-1, -2, 0], columns: 3, spacing: 15 cm}}"))


@dangerous
def grid_of_starts_with_one_in_the_pillar(mission: Mission) -> Changes:
    """The fifth vehicle of the grid stands where the pillar stands."""
    for vehicle in mission.own():
        starts, pillar = mission.at("starts", of=vehicle.node), mission.at("world", "obstacles")
        if starts and pillar:
            text = "{grid: {at: [-1, -1, 0], columns: 3, spacing: 1 m}}"
            yield change(put(starts, text), also=(pillar,))


@dangerous
def ring_of_starts_by_a_wrong_difference(mission: Mission) -> Changes:
    """A minus for a plus: six vehicles stand on a circle as wide as one of them."""
    for vehicle in mission.own():
        radius = mission.at("starts", "circle", "radius", of=vehicle.node)
        if radius:
            yield change(put(radius, "$radius - 90 cm"))


@dangerous
def stands_in_mid_air_before_the_start(mission: Mission) -> Changes:
    """The declared start hangs above a metre over the floor, on nothing: the vehicle falls."""
    for vehicle in _first(mission):
        at = mission.items("start", "at", of=vehicle.node)
        if at:
            yield change(put(at[2], "1.2"))


@dangerous
def home_on_the_far_side_of_the_fence(mission: Mission) -> Changes:
    """`go_home` leads to a home that lies two metres beyond the fence."""
    for state in mission.states("go_home"):
        corner = _numbers(mission, "world", "fence", "to")
        vehicle = next(v for v in mission.vehicles() if v.name == state.vehicle)
        if corner:
            home = f"home: [{corner[0] + 2:g}, 0, 0]"
            yield change(add(vehicle.node, home), also=(state.key,))


@dangerous
def comes_home_above_the_ceiling(mission: Mission) -> Changes:
    """The safe height of the way home is above the fence."""
    if _has_own_room(mission):
        yield from _states(mission, "height", "4 m", "go_home")


# Estimators


@dangerous
def dead_reckoning_before_motion_capture(mission: Mission) -> Changes:
    """The first healthy estimator is used, and that is the one that drifts."""
    yield from _estimators(mission, "{use: inertial}", f"{{use: mocap, {HEALTHY}}}")


@dangerous
def fallback_later_than_the_failsafe(mission: Mission) -> Changes:
    """The supervisor lands the vehicle blind at 0.3 s, before dead reckoning may take over."""
    mocap = "{use: mocap, healthy: age < 600 ms and spread < 5 cm, recover_after: 1 s}"
    yield from _estimators(mission, mocap, DEAD_RECKONING)


@dangerous
def motion_capture_back_after_the_fallback_ends(mission: Mission) -> Changes:
    """It must be healthy for 15 s before it counts again; dead reckoning may last for 3 s."""
    mocap = "{use: mocap, healthy: age < 250 ms and spread < 5 cm, recover_after: 15 s}"
    yield from _estimators(mission, mocap, DEAD_RECKONING)


@dangerous
def satellite_positions_in_a_small_room(mission: Mission) -> Changes:
    """Positions with half a metre of error, between walls that are two or three metres away."""
    if _has_own_room(mission):
        entry = "{use: fusion, source: position, healthy: age < 600 ms and spread < 60 cm}"
        yield from _estimators(mission, entry)


@dangerous
def velocity_filtered_for_seconds(mission: Mission) -> Changes:
    """The velocity that damps the position loop lags by about a second: the vehicle swings."""
    yield from _estimators(mission, f"{{use: mocap, velocity_bandwidth: 0.2 Hz, {HEALTHY}}}")


@dangerous
def gate_as_wide_as_the_way_to_a_neighbour(mission: Mission) -> Changes:
    """Where two bodies are swapped, each vehicle takes the other's poses for its own."""
    if len(mission.vehicles()) > 1:
        yield from _estimators(mission, f"{{use: mocap, gate: 5 m, widest_gate: 5 m, {HEALTHY}}}")


@senseless
def healthier_than_poses_can_be(mission: Mission) -> Changes:
    """Poses arrive after 10 ms, so none is ever younger than 5 ms: nothing takes off."""
    yield from _estimators(mission, "{use: mocap, healthy: age < 5 ms and spread < 5 cm}")


@senseless
def prefers_the_only_estimator(mission: Mission) -> Changes:
    """The vehicle has motion capture alone, so that preferring it says nothing."""
    for vehicle in _first(mission):
        if not mission.at("estimators", of=vehicle.node):
            for state in mission.states(*SIDEWAYS):
                if state.vehicle == vehicle.name:
                    edit = with_key(mission, state.node, "estimators", "[mocap]")
                    yield change(edit, also=(state.key,))


@senseless
def autopilot_that_is_told_no_position(mission: Mission) -> Changes:
    """The autopilot awaits its position from the mission, which flies by the autopilot's own."""
    if not mission.at("faults"):
        for vehicle in _alone(mission):
            edit = _given(mission, vehicle.node, "estimators", "[autopilot]")
            yield change(edit, target="px4")


# Trackers and airframes


@dangerous
def leans_less_than_its_path_demands(mission: Mission) -> Changes:
    """0.7 m/s^2 need 4 degrees of tilt, and half a degree is allowed."""
    yield from _tracker(mission, "{use: geometric, tilt: 0.5 deg}", *SIDEWAYS)


@dangerous
def integral_gain_that_makes_it_swing(mission: Mission) -> Changes:
    """More integral gain than the product of the other two: the loop is unstable."""
    yield from _tracker(mission, "{use: cascade, proportional: 9, derivative: 7.5, integral: 95}")


@dangerous
def height_gain_with_a_zero_too_many(mission: Mission) -> Changes:
    """The height's gain of a hundred, ten times that of the other axes, lets it oscillate."""
    gains = "[[9, 0, 0], [0, 9, 0], [0, 0, 100]]"
    yield from _tracker(mission, f"{{use: cascade, position_gain: {gains}}}")


@dangerous
def counts_as_standing_while_it_flies(mission: Mission) -> Changes:
    """`lift_off` is above the height of the flight: for its tracker the vehicle never flies."""
    yield from _tracker(mission, "{use: geometric, lift_off: 4 m}")


@dangerous
def inertia_in_the_wrong_unit(mission: Mission) -> Changes:
    """g m^2 written as kg m^2: a vehicle that its rotors can hardly turn."""
    yield from _airframe(mission, "inertia: [0.45, 0.45, 0.80]")


@dangerous
def airframe_that_hovers_for_seconds(mission: Mission) -> Changes:
    """The battery is empty before the mission is over."""
    yield from _airframe(mission, "endurance: 12 s")


@senseless
def bumper_smaller_than_the_rotors(mission: Mission) -> Changes:
    """The bumper is inside the rotors that it is to go round, so it touches nothing."""
    yield from _airframe(mission, "bumper: 4 cm")


@dangerous
def five_commands_a_second(mission: Mission) -> Changes:
    """The position loop commands attitudes five times a second: the vehicle swings and falls."""
    yield change(_top(mission, "control", "5 Hz"))


@senseless
def tilt_beyond_the_airframes_own(mission: Mission) -> Changes:
    """The airframe allows 20 degrees or less, so that the tracker's 50 say nothing."""
    yield from _tracker(mission, "{use: geometric, tilt: 50 deg}")


@senseless
def autopilots_tracker_in_the_simulator(mission: Mission) -> Changes:
    """`on_board` sends positions, and the simulator takes attitude and thrust only."""
    yield from _tracker(mission, "{use: on_board, by: velocity}")


@senseless
def airframe_too_heavy_for_its_rotors(mission: Mission) -> Changes:
    """Four rotors lift less than the airframe weighs: nothing takes off."""
    yield from _airframe(mission, "mass: 23 kg")


# Processors


@dangerous
def limits_behind_the_evasions(mission: Mission) -> Changes:
    """The limits of speed and acceleration slow down what `avoid_obstacles` does."""
    for _, entries in _avoiding(mission):
        new = "{use: avoid_obstacles, keep: 20 cm}", "limit_speed", "limit_acceleration"
        yield change(*(put(old, text) for old, text in zip(entries[:3], new, strict=True)))


@dangerous
def evasions_behind_the_fence(mission: Mission) -> Changes:
    """What goes round another vehicle is no longer kept inside the fence."""
    for _, entries in _avoiding(mission):
        yield change(
            put(entries[2], "fence"), put(entries[3], "{use: avoid_obstacles, keep: 20 cm}")
        )


@dangerous
def goes_round_one_of_many(mission: Mission) -> Changes:
    """All cross in one place, and everyone keeps away from a single other one."""
    if len(mission.vehicles()) > 2:
        yield from _avoidance(mission, "keep: 20 cm, treat_as_obstacles: [b]")


@dangerous
def keeps_the_thickness_of_a_coin(mission: Mission) -> Changes:
    """`keep` must be more than twice the position error, which is some centimetres."""
    yield from _avoidance(mission, "keep: 2 mm")


@dangerous
def error_alarm_beyond_the_walls(mission: Mission) -> Changes:
    """The vehicle may be ten metres off its setpoint, further than its room is wide."""
    if _has_own_room(mission):
        yield from _processors(mission, position_error="{use: position_error, limit: 10 m}")


@senseless
def keeps_more_than_there_is_room_for(mission: Mission) -> Changes:
    """Nobody gets through between the others or the walls at 1.8 m from each."""
    yield from _avoidance(mission, "keep: 1.8 m")


@senseless
def speed_limit_of_a_snail(mission: Mission) -> Changes:
    """The setpoint lags further and further behind a path that is ten times as fast."""
    limit = "{use: limit_speed, speed: 2 cm/s}"
    yield from _processors(
        mission, "circle", "figure_eight", "follow_trajectory", limit_speed=limit
    )


@senseless
def refuses_the_setpoints_of_all_its_behaviors(mission: Mission) -> Changes:
    """Each behavior of the vehicle gives positions, which `mode_check` doesn't pass."""
    check = "fence, {use: mode_check, position: false}"
    yield from _processors(mission, fence=check)


@senseless
def repulsion_that_ends_where_it_is_largest(mission: Mission) -> Changes:
    """There is no repulsion beyond 20 cm, and it is largest at 60 cm."""
    field = "{use: potential_field, nearest: 60 cm, farthest: 20 cm}"
    if mission.at("world", "obstacles") or len(mission.vehicles()) > 1:
        yield from _processors(mission, obstacle_guard=field)


@senseless
def margin_that_leaves_no_height(mission: Mission) -> Changes:
    """1.6 m from the floor and from the ceiling leave nothing of a room of less than 3.2 m."""
    corner = _numbers(mission, "world", "fence", "to")
    if corner and corner[2] < 3.2:
        yield from _processors(mission, fence="{use: fence, margin: 1.6 m}")


# Supervisors


@dangerous
def fence_alarm_metres_outside(mission: Mission) -> Changes:
    """The supervisor lands the vehicle four metres beyond the fence."""
    yield from _supervisors(mission, "{use: fence, margin: 4 m}")


@dangerous
def falls_when_the_link_hiccups(mission: Mission) -> Changes:
    """Half a second of silence stops the rotors in the air."""
    if "ardrone" not in mission.name:
        yield from _supervisors(mission, "{use: link, reaction: cut}")


@dangerous
def flies_on_without_an_estimate(mission: Mission) -> Changes:
    """A vehicle that doesn't know where it is only warns."""
    yield from _supervisors(mission, "{use: estimate, reaction: warn}")


@dangerous
def alarm_at_every_lean(mission: Mission) -> Changes:
    """Flying sideways needs 4 degrees, at which it would be landed blind."""
    yield from _supervisors(mission, "{use: tilt, limit: 1 deg}", *SIDEWAYS)


@dangerous
def further_apart_than_their_places(mission: Mission) -> Changes:
    """The failsafe brakes vehicles whose formation brings them nearer than its bound."""
    for vehicle in mission.own():
        for entry in mission.items("supervisors", of=vehicle.node):
            distance = mission.at("distance", of=entry)
            if distance:
                yield change(put(distance, "3 m"))


@dangerous
def ardrone_without_its_long_silence(mission: Mission) -> Changes:
    """Its own list replaces the link's 1.5 s of the library: half a second of Wi-Fi lands it."""
    for vehicle in mission.own():
        if mission.word("like", of=vehicle.node) == "std.ardrone":
            edit = add(vehicle.node, "supervisors: [{use: tilt, limit: 45 deg}]")
            yield change(edit, target="lab")


@senseless
def warned_after_the_landing(mission: Mission) -> Changes:
    """The battery's warning comes at 10 %, and the vehicle has landed at 40 %."""
    yield from _supervisors(mission, "{use: battery, warn_below: 10 %, land_below: 40 %}")


@senseless
def brakes_when_it_has_long_landed_blind(mission: Mission) -> Changes:
    """A milder reaction at a wider bound than the one that every vehicle has never counts."""
    yield from _supervisors(mission, "{use: estimate, as: unsure, spread: 2 m, reaction: brake}")


# Behaviors and their transitions


@dangerous
def lands_on_the_pad_of_all_others(mission: Mission) -> Changes:
    """The others inherit the place, so all land on one point."""
    for state in mission.states("land"):
        likes = [mission.word("like", of=v.node) for v in mission.vehicles()]
        if state.vehicle in likes and not mission.at("position", of=state.node):
            edit = add_last(state.node, "position: [0.5, 0.5, 0]")
            yield change(edit, also=(state.key,))


@dangerous
def lands_on_the_edge_of_a_crate(mission: Mission) -> Changes:
    """Half of its legs are in the air."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        low = _numbers(mission, "box", "from", of=obstacle)
        high = _numbers(mission, "box", "to", of=obstacle)
        if low and high and high[2] < 2:
            at = f"[{low[0]:g}, {(low[1] + high[1]) / 2:g}, {high[2]:g}]"
            for state in mission.states("land"):
                yield change(with_key(mission, state.node, "position", at), also=(obstacle,))


@dangerous
def circle_drawn_on_the_floor(mission: Mission) -> Changes:
    """The centre's height is that of the floor, and so is the whole circle's."""
    for state in mission.states("circle"):
        center = mission.items("center", of=state.node)
        yield change(put(center[2], "0"), also=(state.key,))


@dangerous
def flies_on_through_the_fence(mission: Mission) -> Changes:
    """It flies on for twenty metres in a room of a few."""
    if _has_own_room(mission):
        for state in mission.states("hover"):
            then = mission.word("then", of=state.node)
            if then:
                text = f"{{do: run_until, velocity: [0.8, 0, 0], at_most: 20 m, then: {then}}}"
                yield change(put(state.node, text), also=(state.key,))


@dangerous
def two_states_that_hand_over_forever(mission: Mission) -> Changes:
    """Each hover leads to the other one; the vehicle hangs there until something lands it."""
    for state in mission.states("hover"):
        behaviors = mission.at("vehicles", state.vehicle, "behaviors")
        then = mission.at("then", of=state.node)
        if then and behaviors and mission.at("for_time", of=state.node):
            again = f"again: {{do: hover, for_time: 2 s, then: {state.name}}}"
            yield change(put(then, "again"), add_last(behaviors, again), also=(state.key,))


@dangerous
def takes_off_after_every_landing(mission: Mission) -> Changes:
    """It flies lap by lap until its battery is low."""
    for vehicle in _alone(mission):
        climbs = [s.name for s in mission.states("take_off") if s.vehicle == vehicle.name]
        for state in mission.states("land"):
            if state.vehicle == vehicle.name and climbs:
                edit = with_key(mission, state.node, "then", climbs[0])
                yield change(edit, also=(state.key,))


@dangerous
def corners_in_the_wrong_order(mission: Mission) -> Changes:
    """Two corners of the square are exchanged: its diagonals lead through the pillar."""
    for vehicle in mission.own():
        for key, state in mission.pairs("behaviors", of=vehicle.node):
            second, third = mission.at("b", of=state), mission.at("c", of=state)
            if second and third:
                edits = put(second, mission.source(third)), put(third, mission.source(second))
                yield change(*edits, also=(key,))


@dangerous
def short_cut_through_the_pillar(mission: Mission) -> Changes:
    """The corner that leads round the pillar is left out."""
    for state in mission.states("follow_path"):
        corners = mission.items("path", of=state.node)
        if all(isinstance(corner, yaml.ScalarNode) for corner in corners):
            path = mission.at("path", of=state.node)
            assert path is not None
            yield change(put(path, f"[{mission.source(corners[-1])}]"), also=(state.key,))


@senseless
def slows_down_to_a_higher_speed(mission: Mission) -> Changes:
    """Near the ground it descends faster than above."""
    for state in mission.states("land"):
        edit = add_last(state.node, "speed: 15 cm/s, slow_speed: 45 cm/s")
        yield change(edit, also=(state.key,))


@senseless
def arrives_without_going_there(mission: Mission) -> Changes:
    """Every place of the room counts as arrived."""
    yield from _states(mission, "tolerance", "12 m", "fly_to", "follow_path")


@senseless
def arrives_finer_than_it_can_measure(mission: Mission) -> Changes:
    """Poses have half a millimetre of noise, so that a hundredth of one is never reached."""
    yield from _states(mission, "tolerance", "0.01 mm", "fly_to", "follow_path")


@senseless
def begins_with_its_landing(mission: Mission) -> Changes:
    """It stands on the ground, lands there, and the flight is over."""
    for vehicle in _alone(mission):
        landing = mission.landing(vehicle.name)
        if landing:
            yield change(add(vehicle.node, f"begin: {landing}"))


@senseless
def waits_on_the_ground_for_nothing(mission: Mission) -> Changes:
    """`wait_on_ground` never ends by itself, so what follows never comes."""
    for vehicle in _alone(mission):
        behaviors = mission.at("behaviors", of=vehicle.node)
        climbs = [s.name for s in mission.states("take_off") if s.vehicle == vehicle.name]
        if behaviors and climbs:
            yield change(add(behaviors, f"ready: {{do: wait_on_ground, then: {climbs[0]}}}"))


@senseless
def later_than_its_own_limit(mission: Mission) -> Changes:
    """The state has failed after 20 s, before its transition's time comes."""
    for state in mission.states("hover"):
        landing = mission.landing(state.vehicle)
        for transition in mission.items("next", of=state.node):
            after = mission.quantity(mission.at("after", of=transition))
            if landing and after and after.number > 20:
                edit = add_last(state.node, f"within: 20 s, failed: {landing}")
                yield change(edit, also=(state.key, transition))


@senseless
def two_answers_to_one_button(mission: Mission) -> Changes:
    """The first transition is taken, so the second one for the event never is."""
    for state in mission.states("hover", "steer", "circle"):
        following = mission.at("next", of=state.node)
        for transition in mission.items("next", of=state.node)[:1]:
            event = mission.word("event", of=transition)
            if following and event and mission.word("go", of=transition) != state.name:
                again = f"{{event: {event}, go: brake}}"
                yield change(append(following, again), also=(transition, state.key))


@senseless
def chain_that_may_take_three_seconds(mission: Mission) -> Changes:
    """`within` counts from the chain's entry, and four corners take a quarter of a minute."""
    for vehicle in mission.own():
        for key, state in mission.pairs("behaviors", of=vehicle.node):
            within = mission.at("within", of=state)
            if mission.word("do", of=state).startswith("chain.") and within:
                yield change(put(within, "3 s"), also=(key,))


@senseless
def one_stack_twice(mission: Mission) -> Changes:
    """Each part of the stack is there a second time, by the same name."""
    for vehicle in mission.own():
        for entry in mission.items("processors", of=vehicle.node):
            stack, node = mission.word("stack", of=entry), mission.at("processors", of=vehicle.node)
            if stack and node:
                yield change(append(node, f"{{stack: {stack}}}"))


@senseless
def begins_its_trajectory_elsewhere(mission: Mission) -> Changes:
    """The file begins at 1.2 m, further from the take-off's height than the gate allows."""
    for state in mission.states("take_off"):
        files = [s.key for s in mission.states("follow_trajectory") if s.vehicle == state.vehicle]
        height = mission.at("height", of=state.node)
        if files and height:
            yield change(put(height, "40 cm"), also=(*files, state.key))


# Several vehicles


@dangerous
def wingman_inside_its_own_clearance(mission: Mission) -> Changes:
    """The place beside the leader is nearer than the two may come."""
    for state in mission.states("follow"):
        yield change(with_key(mission, state.node, "offset", "[0, 0.2, 0]"), also=(state.key,))


@dangerous
def shape_smaller_than_its_vehicles(mission: Mission) -> Changes:
    """Neighbouring places are closer than the rotors reach."""
    for state in mission.states("formation"):
        side = mission.at("side", of=state.node)
        if side:
            yield change(put(side, "15 cm"), also=(state.key,))


@dangerous
def two_members_in_one_place(mission: Mission) -> Changes:
    """The last place of the shape is a copy of the first."""
    for state in mission.states("formation"):
        points = mission.items("points", of=state.node)
        if points:
            yield change(put(points[-1], mission.source(points[0])), also=(state.key,))


@dangerous
def flow_that_ends_in_the_air(mission: Mission) -> Changes:
    """The last phase has them hover, until the limit of the built-in hover lands them."""
    for name, phase in mission.phases():
        last = not mission.at("next", of=phase)
        for _, request in mission.pairs("run", of=phase):
            if last and name in ("land", "landing"):
                yield change(put(request, "hover"))


@dangerous
def hover_shorter_than_the_wait(mission: Mission) -> Changes:
    """Who is first waits in `hover` for the others, and is landed after a second."""
    waits = any(mission.at("give", of=phase) for _, phase in mission.phases())
    if waits or mission.states("follow"):
        yield change(_top(mission, "hover_limit", "1 s"))


@senseless
def follows_its_own_follower(mission: Mission) -> Changes:
    """The leader follows the one that follows it, so that neither leads anywhere."""
    for state in mission.states("follow"):
        leader = mission.word("vehicle", of=state.node)
        for other in mission.states("circle"):
            if other.vehicle == leader:
                text = (
                    f"{{do: follow, vehicle: {state.vehicle}, offset: [0, -1.2, 0], then: hover}}"
                )
                yield change(put(other.node, text), also=(other.key, state.key))


@senseless
def messages_older_than_they_may_be(mission: Mission) -> Changes:
    """Each message is 350 ms old when it is heard, and silence begins at 100 ms."""
    for state in mission.states("formation"):
        delay = mission.at("delay", of=state.node)
        if delay:
            yield change(put(delay, "350 ms, freshness: 100 ms"), also=(state.key,))


@senseless
def leader_that_is_a_member(mission: Mission) -> Changes:
    """The shape's centre moves with a vehicle whose place moves with the centre."""
    for state in mission.states("formation"):
        leader = mission.at("leader", of=state.node)
        if leader:
            yield change(put(leader, state.vehicle), also=(state.key,))


@senseless
def path_under_the_lowest_height(mission: Mission) -> Changes:
    """A formation keeps 40 cm from the ground, so it never reaches a corner at 15 cm."""
    for state in mission.states("formation"):
        for corner in mission.items("path", of=state.node)[:1]:
            height = corner.value[2]
            yield change(put(height, "0.15"), also=(state.key,))


@senseless
def otherwise_takes_off_in_the_air(mission: Mission) -> Changes:
    """Who is late is asked to take off again, which is refused to a vehicle in the air."""
    phases = dict(mission.phases())
    for name, phase in phases.items():
        otherwise = mission.at("otherwise", of=phase)
        if otherwise and "launch" in phases and name in ("tour", "cross", "gather", "turn"):
            yield change(put(otherwise, "launch"), also=(phases["launch"],))


@senseless
def waits_for_what_held_before(mission: Mission) -> Changes:
    """All have landed before they take off, so that the phase is over at once."""
    for name, phase in mission.phases():
        for transition in mission.items("next", of=phase):
            when = mission.at("when", of=transition)
            if name == "launch" and when:
                edit = put(when, mission.word("when", of=transition).replace("hover", "landed"))
                yield change(edit)


@senseless
def together_around_a_circle(mission: Mission) -> Changes:
    """`together` is for straight lines, and these fly circles."""
    circles = {state.name for state in mission.states("circle")}
    for _, phase in mission.phases():
        requests = {node.value for _, node in mission.pairs("run", of=phase)}
        if requests & circles and not mission.at("arrive", of=phase):
            yield change(add(phase, "arrive: together"))


@senseless
def takes_turns_to_form_up(mission: Mission) -> Changes:
    """The first waits in the formation for the others, who wait until it has left."""
    shapes = {state.name for state in mission.states("formation")}
    for _, phase in mission.phases():
        requests = {node.value for _, node in mission.pairs("run", of=phase)}
        if requests & shapes and not mission.at("give", of=phase):
            yield change(add(phase, "arrive: in_turns"))


@senseless
def keeps_what_the_other_flow_needs(mission: Mission) -> Changes:
    """The flow never gives the vehicle that another flow flies and for whose end it waits."""
    for _, phase in mission.phases():
        give = mission.at("give", of=phase)
        if give:
            yield change(drop(mission, phase, "give"), also=(phase,))


# The world


@dangerous
def ball_across_the_take_off(mission: Mission) -> Changes:
    """A ball swings through the column in which the vehicle climbs, which nothing protects."""
    for vehicle in _first(mission):
        at = _numbers(mission, "start", "at", of=vehicle.node)
        if at and _has_own_room(mission):
            x, y, _ = at
            along = f"[[{x - 0.8:g}, {y:g}, 0.6], [{x + 0.8:g}, {y:g}, 0.6]]"
            ball = f"swing: {{moving_sphere: {{along: {along}, radius: 20 cm, speed: 60 cm/s}}}}"
            yield change(_obstacle(mission, ball), also=(vehicle.key,))


@dangerous
def crate_where_it_is_to_fly(mission: Mission) -> Changes:
    """An object as tall as the flight stands at the goal; the airframe has no bumper."""
    for state in mission.states("fly_to"):
        at = _numbers(mission, "position", of=state.node)
        if at and _has_own_room(mission):
            size = at[2] + 0.4
            where = f"[{at[0]:g}, {at[1]:g}, {size / 2 - 0.05:g}]"
            entry = f"tower: {{at: {where}, size: [0.4, 0.4, {size:g}], mass: 8 kg}}"
            yield change(_object(mission, entry), also=(state.key,))


@dangerous
def floor_without_the_tags_that_it_needs(mission: Mission) -> Changes:
    """Only the pad keeps its tags: a metre further the vehicle doesn't know where it is."""
    if mission.word("world") == "rooms.tag_floor":
        world = mission.at("world")
        assert world is not None
        yield change(put(world, "{like: rooms.tag_floor, tags: {floor: null}}"))


@dangerous
def parcel_heavier_than_the_thrust_left(mission: Mission) -> Changes:
    """With the parcel the rotors hover at nearly their largest thrust."""
    for vehicle in mission.own():
        if mission.word("like", of=vehicle.node) == "lab.courier":
            yield change(add(vehicle.node, "payload: {mass: 2.2 kg}"))


@senseless
def ball_that_goes_nowhere(mission: Mission) -> Changes:
    """Both ends of the moving obstacle's path are one point."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        along = mission.at("moving_sphere", "along", of=obstacle)
        if along:
            point = mission.source(along.value[0])
            yield change(put(along, f"[{point}, {point}]"))
    corner = _free_corner(mission)
    if corner:
        point = f"[{corner[0] - 0.4:g}, {corner[1] - 0.4:g}, 2]"
        ball = f"{{along: [{point}, {point}], radius: 10 cm, speed: 30 cm/s}}"
        yield change(_obstacle(mission, f"ball: {{moving_sphere: {ball}}}"))


@senseless
def ball_with_the_body_of_a_vehicle(mission: Mission) -> Changes:
    """Motion capture can't see an obstacle and a vehicle as one body."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        ball = mission.at("moving_sphere", of=obstacle)
        for vehicle in mission.own():
            if ball:
                yield change(add_last(ball, f"body: {vehicle.name}"))


@senseless
def object_that_hangs_in_the_air(mission: Mission) -> Changes:
    """Without a joint it falls from where it is declared."""
    corner = _free_corner(mission)
    if corner:
        at = f"[{corner[0] - 0.4:g}, {corner[1] - 0.4:g}, 1.5]"
        yield change(_object(mission, f"lamp: {{at: {at}, size: [0.2, 0.2, 0.2], mass: 1 kg}}"))


def _cart(mission: Mission, slide: str) -> Changes:
    corner = _free_corner(mission)
    if corner:
        at = f"at: [{corner[0] - 0.5:g}, {corner[1] - 0.3:g}, 0.5]"
        entry = f"wagon: {{{at}, size: [0.2, 0.2, 0.1], mass: 1 kg, slide: {slide}}}"
        yield change(_object(mission, entry))


@senseless
def stops_of_a_rail_exchanged(mission: Mission) -> Changes:
    """The stop behind is ahead of the stop ahead."""
    yield from _cart(mission, "{along: [1, 0, 0], from: 20 cm, to: -20 cm}")


@senseless
def rail_without_a_direction(mission: Mission) -> Changes:
    """The cart slides along a vector of length zero."""
    yield from _cart(mission, "{along: [0, 0, 0], from: -20 cm, to: 20 cm}")


@senseless
def cart_starts_off_its_rail(mission: Mission) -> Changes:
    """It starts a metre behind the stop ahead."""
    yield from _cart(mission, "{along: [1, 0, 0], from: -20 cm, to: 20 cm, start: 1.2 m}")


@senseless
def wall_that_faces_away(mission: Mission) -> Changes:
    """All that is behind a wall is solid, and behind this one is the room."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        facing = mission.items("plane", "facing", of=obstacle)
        turned = [f"{0 - float(axis.value):g}" for axis in facing]
        node = mission.at("plane", "facing", of=obstacle)
        if node:
            yield change(put(node, f"[{', '.join(turned)}]"))


@senseless
def tag_numbers_of_another_grid(mission: Mission) -> Changes:
    """A second pad repeats the numbers of the first, and nobody can tell the two apart."""
    if mission.word("world") == "rooms.tag_floor":
        world = mission.at("world")
        assert world is not None
        grid = (
            "{family: 36h11, count: [3, 3], size: 5 cm, spacing: 1 cm, first: 200, at: [2, 2, 0]}"
        )
        yield change(put(world, f"{{like: rooms.tag_floor, tags: {{second: {{grid: {grid}}}}}}}"))


@senseless
def camera_that_looks_at_the_ceiling(mission: Mission) -> Changes:
    """The tags are on the floor."""
    for vehicle in mission.own():
        if mission.word("like", of=vehicle.node) == "lab.courier":
            ours = "ours: {like: lab.courier, cameras: {down: {facing: up}}}"
            edits = own_section(mission, "airframes", ours), add(vehicle.node, "airframe: ours")
            yield change(*edits)


@senseless
def releases_what_it_never_loaded(mission: Mission) -> Changes:
    """The parcel is not on board, and nothing loads it."""
    for vehicle in mission.own():
        if mission.states("release_payload") and not mission.states("load_payload"):
            keys = tuple(state.key for state in mission.states("release_payload"))
            yield change(add(vehicle.node, "payload: {aboard: false}"), also=keys)


# The simulated lab


@dangerous
def poses_of_which_none_may_be_lost(mission: Mission) -> Changes:
    """Six poses a second, and each hundredth is lost: then the estimate is too old to fly on."""
    yield from _in_simulation(mission, "mocap_rate: 6 Hz")


@dangerous
def storm_in_the_laboratory(mission: Mission) -> Changes:
    """No tilt that the airframe allows holds the vehicle against this wind."""
    yield from _in_simulation(mission, "wind: [0, 16, 0]", tags=True)


@dangerous
def nothing_lands_it_when_commands_stop(mission: Mission) -> Changes:
    """The vehicle keeps its last command when the computer is gone."""
    yield from _in_simulation(mission, "watchdog: false", tags=True)


@dangerous
def nearly_every_tag_covered(mission: Mission) -> Changes:
    """The vehicle flies by tags, and one in fifty is left."""
    covered = mission.at("targets", "sim", "courier", "sensors", "fusion", "covered")
    if covered:
        yield change(put(covered, "98 %"))
    elif mission.word("world") == "rooms.tag_floor":
        sensor = "{fusion: {use: simulated_camera, covered: 98 %}}"
        yield change(own_section(mission, "targets", f"sim: {{courier: {{sensors: {sensor}}}}}"))


@senseless
def frames_later_than_the_filter_remembers(mission: Mission) -> Changes:
    """`fusion` remembers half a second, and frames arrive after 0.9 s."""
    camera = mission.at("targets", "sim", "courier", "sensors", "fusion")
    if camera:
        yield change(add_last(camera, "latency: 0.9 s"))
    elif mission.word("world") == "rooms.tag_floor":
        sensor = "{fusion: {use: simulated_camera, latency: 0.9 s}}"
        yield change(own_section(mission, "targets", f"sim: {{courier: {{sensors: {sensor}}}}}"))


@senseless
def too_few_poses_for_the_preflight(mission: Mission) -> Changes:
    """The preflight asks for five poses a second, and two come."""
    yield from _in_simulation(mission, "mocap_rate: 2 Hz")


# Inputs and haptics


@dangerous
def waits_minutes_for_a_lost_stick(mission: Mission) -> Changes:
    """The vehicle hangs in the air for five minutes after its controller is gone."""
    yield from _states(mission, "patience", "5 min", "steer")


@dangerous
def one_lever_for_two_axes(mission: Mission) -> Changes:
    """Who pushes the left stick to climb flies forward too."""
    stick = mission.at("targets", "hands", "inputs", "stick")
    if stick:
        yield change(add_last(stick, "x: -left_y"), target="hands")


@senseless
def must_stay_above_the_ceiling(mission: Mission) -> Changes:
    """The lowest height for steering is higher than the fence."""
    if _has_own_room(mission):
        yield from _states(mission, "lowest", "4 m", "steer")


@senseless
def tilt_of_a_stick_that_commands_velocities(mission: Mission) -> Changes:
    """Without `by: tilt` or `by: signals` no stick commands a tilt."""
    yield from _states(mission, "tilt", "12 deg", "steer")


@senseless
def lands_on_the_dead_man_button(mission: Mission) -> Changes:
    """Whoever holds the dead-man button to steer thereby lands the vehicle."""
    for _, node in mission.pairs("inputs"):
        button, dead_man = mission.at("buttons", "land", of=node), mission.word("dead_man", of=node)
        if button and dead_man:
            yield change(put(button, dead_man))


@senseless
def script_of_another_operator(mission: Mission) -> Changes:
    """The buttons for which the mission waits are never pressed in that recording."""
    for _, node in mission.pairs("inputs"):
        file = mission.at("file", of=node)
        if file:
            other = "corridor" if "joystick" in str(file.value) else "joystick"
            yield change(put(file, f"operators/{other}.csv"))


@senseless
def hand_of_a_device_that_has_a_real_one(mission: Mission) -> Changes:
    """A script moves the hand of a simulated device only."""
    device = mission.at("targets", "haptic", "inputs", "stick", "device")
    if device:
        yield change(put(device, "force_dimension"), target="haptic")


@senseless
def four_buttons_for_eight_events(mission: Mission) -> Changes:
    """A haptic device has four buttons, and the flows wait for twice as many."""
    stick = mission.at("targets", "haptic", "inputs", "stick")
    if stick:
        yield change(put(stick, "{use: haptic}"), target="haptic")


@senseless
def force_that_no_hand_feels(mission: Mission) -> Changes:
    """Forces of newtons are cut off at a thousandth of one."""
    stick = mission.at("targets", "haptic", "inputs", "stick")
    if stick:
        yield change(add_last(stick, "force: 6 N, most: 1 mN"), target="haptic")


@senseless
def transmitter_that_nobody_reports(mission: Mission) -> Changes:
    """Neither the simulator nor an emulated autopilot has a receiver for a transmitter."""
    stick, vehicle = mission.at("targets", "hands", "inputs", "stick"), mission.vehicles()[0].name
    if stick:
        start, text = stick.start_mark.index, mission.source(stick).rstrip()
        edit = Edit(start, start + len(text), f"{{use: sticks, vehicle: {vehicle}}}")
        yield change(edit, target="hands")


# AR.Drones and autopilots


@dangerous
def somersault_in_the_circle(mission: Mission) -> Changes:
    """A flip interrupts the tracker on a circle with neighbours, with 0.5 m for its error."""
    driver = mission.at("targets", "lab", "a", "driver")
    for state in mission.states("circle"):
        if driver and mission.word("use", of=driver) == "ardrone":
            flip = f"{{perform: {{{state.vehicle}: flip_left}}}}"
            event, keys = f"{state.vehicle}.behavior_started", f"behavior: {state.name}, "
            edits = add_last(driver, "maneuvers: true"), _on(mission, event, flip, keys=keys)
            yield change(*edits, target="lab")


@dangerous
def two_drones_at_one_address(mission: Mission) -> Changes:
    """Two vehicles command one drone, and the other one gets nothing."""
    hosts = [mission.at("targets", "lab", name, "driver", "host") for name in "ab"]
    if hosts[0] and hosts[1]:
        edit = put(hosts[1], str(hosts[0].value))
        yield change(edit, also=(hosts[0],), target="lab")


@dangerous
def ardupilot_by_attitude_and_thrust(mission: Mission) -> Changes:
    """ArduPilot fell after each take-off with such commands."""
    driver = "{use: mavlink, autopilot: ardupilot, simulator: true, attitude: true}"
    yield from _target(mission, "tried", f"{{all: {{driver: {driver}, tracker: geometric}}}}")


@dangerous
def ardupilot_that_is_not_told_to_keep_its_height(mission: Mission) -> Changes:
    """ArduPilot integrates accelerations to a height; without `keeps_height` it oscillates."""
    driver = "{use: mavlink, autopilot: ardupilot, simulator: true}"
    tracker = "{use: on_board, by: acceleration}"
    yield from _target(mission, "tried", f"{{all: {{driver: {driver}, tracker: {tracker}}}}}")


@senseless
def somersault_that_the_driver_forbids(mission: Mission) -> Changes:
    """The driver refuses flight animations without `maneuvers: true`."""
    driver = mission.at("targets", "lab", "a", "driver")
    if driver and mission.word("use", of=driver) == "ardrone":
        yield change(_on(mission, "a.took_off", "{perform: {a: flip_forward}}"), target="lab")


@senseless
def ceiling_of_the_drone_below_its_flight(mission: Mission) -> Changes:
    """The drone itself stays below 60 cm, and is to fly at a metre."""
    for name in "abc":
        driver = mission.at("targets", "lab", name, "driver")
        if driver and mission.word("use", of=driver) == "ardrone":
            yield change(add_last(driver, "altitude_max: 60 cm"), target="lab")


@senseless
def radio_too_slow_for_the_preflight(mission: Mission) -> Changes:
    """The round trip exceeds the latency for which the gains are by more than 0.15 s."""
    if "ardrone" in mission.name:
        driver = "{use: emulated_ardrone, wifi_latency: 0.45 s}"
        entry = f"emulated_ardrone: {{all: {{driver: {driver}}}}}"
        yield change(own_section(mission, "targets", entry), target="emulated_ardrone")


@senseless
def lights_that_the_vehicle_lacks(mission: Mission) -> Changes:
    """The simulator performs no acts, so that the request is refused."""
    if "ardrone" not in mission.name:
        yield from _once_up(mission, "{perform: {VEHICLE: leds_fire}}")


@senseless
def default_rates_over_a_slow_radio(mission: Mission) -> Changes:
    """Fifty setpoints and thirty poses a second don't fit a line of 57600 baud."""
    address = '"serial:/dev/ttyUSB0:57600"'
    driver = f"{{use: mavlink, autopilot: px4, address: {address}}}"
    sensors = "{mocap: {use: vrpn, host: 192.168.0.10}}"
    if _alone(mission) and len(mission.vehicles()) == 1:
        yield from _target(mission, "radio", f"{{all: {{driver: {driver}, sensors: {sensors}}}}}")


@senseless
def all_autopilots_with_one_number(mission: Mission) -> Changes:
    """The messages of a second vehicle with the same system id are dropped."""
    if len(mission.vehicles()) > 1:
        driver = "{use: mavlink, autopilot: px4, simulator: true, system: 1}"
        yield from _target(mission, "one", f"{{all: {{driver: {driver}}}}}")


@senseless
def autopilot_as_from_the_factory(mission: Mission) -> Changes:
    """The preflight refuses the parameters with which an autopilot is delivered."""
    driver = "{use: emulated_autopilot, prepared: false}"
    yield from _target(mission, "factory", f"{{all: {{driver: {driver}}}}}")


# Callbacks, and options set in flight


@dangerous
def gives_way_to_nobody_once_up(mission: Mission) -> Changes:
    """The one processor that keeps the vehicle from what is in its way is switched off."""
    for vehicle, _ in _avoiding(mission) if mission.at("world", "obstacles") else ():
        off = f"{{disable: {vehicle.name}.processors.avoid_obstacles}}"
        yield change(_on(mission, f"{vehicle.name}.took_off", off), also=(vehicle.key,))


@dangerous
def gain_raised_in_flight(mission: Mission) -> Changes:
    """A gain of 300 after the take-off lets the vehicle oscillate until it falls."""
    yield from _once_up(mission, "{set: {VEHICLE.tracker.proportional: 300}}")


@senseless
def run_that_stops_at_the_take_off(mission: Mission) -> Changes:
    """Everything lands as soon as it flies, and nothing of the mission comes."""
    yield from _once_up(mission, '{stop: "it flies"}')


@senseless
def events_that_answer_each_other(mission: Mission) -> Changes:
    """Each event emits the other one, in every tick until the run ends."""
    for vehicle in _named(mission):
        first = _on(mission, f"{vehicle.name}.landed", "{emit: ping}")
        answers = [
            _on(mission, one, f"{{emit: {other}}}")
            for one, other in (("ping", "pong"), ("pong", "ping"))
        ]
        if mission.at("on"):
            yield change(first, *answers)
        else:
            items = "  - {event: ping, do: [{emit: pong}]}\n  - {event: pong, do: [{emit: ping}]}\n"
            text = first.text.rstrip() + "\n" + items + "\n"
            yield change(first._replace(text=text))


@senseless
def commands_a_vehicle_that_its_failsafe_lands(mission: Mission) -> Changes:
    """During a failsafe every request is refused."""
    for vehicle in _named(mission):
        states = [s.name for s in mission.states(*SIDEWAYS, "hover") if s.vehicle == vehicle.name]
        if states:
            action = f"{{switch: {{{vehicle.name}: {states[0]}}}}}"
            event = f"{vehicle.name}.failsafe_started"
            yield change(_on(mission, event, action, keys="reaction: land, "))


@senseless
def change_to_an_estimator_that_it_lacks(mission: Mission) -> Changes:
    """The vehicle has motion capture alone and never changes to dead reckoning."""
    for vehicle in _named(mission):
        if mission.at("estimators", of=vehicle.node):
            continue
        log = '{log: "{vehicle} reckons"}'
        event = f"{vehicle.name}.estimator_changed"
        yield change(_on(mission, event, log, keys="estimator: inertial, "))


@senseless
def a_lap_too_many(mission: Mission) -> Changes:
    """The behavior ends before the lap for which the callback waits."""
    for state in mission.states("circle", "figure_eight"):
        laps = mission.quantity(mission.at("laps", of=state.node))
        if laps and not mission.at("vehicles", state.vehicle, "count"):
            event, log = f"{state.vehicle}.lap_completed", '{log: "{vehicle} is done"}'
            edit = _on(mission, event, log, keys=f"lap: {laps.number + 3:g}, ")
            yield change(edit, also=(state.key,))


@senseless
def switches_on_what_is_never_off(mission: Mission) -> Changes:
    """Nothing of the mission switches the processor off."""
    yield from _once_up(mission, "{enable: VEHICLE.processors.limit_speed}")


@senseless
def margin_loosened_in_flight(mission: Mission) -> Changes:
    """A safety part's margin goes only up in flight, so the vehicle refuses the value."""
    yield from _once_up(mission, "{set: {VEHICLE.processors.fence.margin: 1 cm}}")


@senseless
def callback_for_two_states_at_once(mission: Mission) -> Changes:
    """Exactly one behavior is active, so the condition never holds."""
    for vehicle in _named(mission):
        names = [s.name for s in mission.states() if s.vehicle == vehicle.name]
        if len(names) > 1:
            when = f"{vehicle.name} in {names[0]} and {vehicle.name} in {names[1]}"
            item = f'{{when: {when}, do: [{{log: "both"}}]}}'
            yield change(own_list(mission, "on", item))


# Faults, expectations and parameters


@senseless
def fault_that_changes_nothing(mission: Mission) -> Changes:
    """The fault's values are those of a vehicle without a fault."""
    harmless = (
        "inject: mass_change",
        "inject: gust, velocity: [0, 0, 0], for: 2 s",
        "inject: rotor_weak, left: 100 %",
    )
    for vehicle in _named(mission):
        for fault in harmless:
            item = f"{{at: 6 s, on: {vehicle.name}, {fault}}}"
            yield change(own_list(mission, "faults", item))


@senseless
def darkens_a_camera_that_it_lacks(mission: Mission) -> Changes:
    """The vehicle flies by motion capture and has no camera."""
    for vehicle in _named(mission):
        if "ardrone" not in mission.name:
            item = f"{{at: 6 s, on: {vehicle.name}, inject: camera_dark, for: 1 s}}"
            yield change(own_list(mission, "faults", item))


@senseless
def hides_from_motion_capture_what_flies_by_tags(mission: Mission) -> Changes:
    """The vehicle uses no motion capture, whose loss therefore tests nothing."""
    if mission.word("world") == "rooms.tag_floor":
        item = "{when: behavior == out, on: courier, inject: mocap_dropout, for: 2 s}"
        yield change(own_list(mission, "faults", item))


@senseless
def silences_whom_nobody_hears(mission: Mission) -> Changes:
    """No vehicle follows or flies in formation, so nobody misses the messages."""
    for vehicle in _named(mission):
        if not mission.states("formation", "follow"):
            item = f"{{at: 6 s, on: {vehicle.name}, inject: neighbours_lost, for: 2 s}}"
            yield change(own_list(mission, "faults", item))


@senseless
def expects_what_holds_at_the_start(mission: Mission) -> Changes:
    """Every vehicle is `landed` before it takes off, so this proves nothing."""
    for vehicle in _named(mission):
        yield change(own_list(mission, "expect", f"eventually {vehicle.name} in landed"))


@senseless
def error_of_a_vehicle_on_the_ground(mission: Mission) -> Changes:
    """`position_error` is only known in the air."""
    for vehicle in _named(mission):
        item = f"max({vehicle.name}.position_error in landed) < 3 cm"
        yield change(own_list(mission, "expect", item))


@senseless
def always_higher_than_its_start(mission: Mission) -> Changes:
    """A vehicle that starts on the floor can't always be above it."""
    for vehicle in _named(mission):
        item = f"always {vehicle.name}.state.altitude > 40 cm"
        yield change(own_list(mission, "expect", item))


@senseless
def may_take_longer_than_it_can(mission: Mission) -> Changes:
    """The run ends after 600 s at the latest, so that an hour is no bound."""
    for expectation in mission.expectations("finished within"):
        yield change(put(expectation, "finished within 60 min"))


@senseless
def lap_left_out_of_the_speed(mission: Mission) -> Changes:
    """A radius times a number is a length, and a speed is needed."""
    for state in mission.states("circle"):
        speed = mission.at("speed", of=state.node)
        if speed and "$lap" in str(speed.value):
            yield change(put(speed, "$radius * 6.28"), also=(state.key,))


# Other sensible missions


def _renamed(mission: Mission, **names: str) -> Changes:
    """Names of vehicles or states become others wherever they stand for themselves."""
    begin = mission.text.index("\n", mission.text.index("\nsummary:") + 1)
    own = {v.name for v in mission.vehicles()} | {s.name for s in mission.states()}
    edits = [
        Edit(match.start(), match.end(), new)
        for old, new in names.items()
        if old in own
        for match in re.finditer(rf"(?<![\w./$-]){old}(?![\w:]*\.(?:yaml|csv)|\w)", mission.text)
        if match.start() > begin
    ]
    if edits:
        yield change(*edits)


@valid
def vehicles_with_spanish_names(mission: Mission) -> Changes:
    """Names are free."""
    if mission.name in ("first_flight", "sidestep", "windy", "fallback", "mass_pickup"):
        yield from _renamed(mission, nano="abeja", mk="halcon")


@valid
def states_with_german_names(mission: Mission) -> Changes:
    """Names are free."""
    if mission.name in ("first_flight", "sidestep", "windy", "mass_pickup", "trajectory"):
        names = {"steady": "ruhe", "hold": "halten", "stop": "anhalten", "square": "viereck"}
        yield from _renamed(mission, **names, empty="leer", loaded="beladen", clover="klee")


@valid
def summary_in_french(mission: Mission) -> Changes:
    """A summary may be in any language."""
    summary = mission.at("summary")
    if summary:
        yield change(put(summary, "Décollage, vol à vitesse modérée, puis atterrissage."))


@valid
def log_in_japanese(mission: Mission) -> Changes:
    """A logged text may be in any language."""
    yield from _once_up(mission, '{log: "{vehicle} 離陸 {time}"}')


@valid
def dead_reckoning_as_the_manual_advises(mission: Mission) -> Changes:
    """The documentation recommends it."""
    for vehicle in _first(mission):
        if not mission.at("estimators", of=vehicle.node) and "ardrone" not in mission.name:
            mocap = f"{{use: mocap, {HEALTHY}}}"
            yield change(add(vehicle.node, f"estimators: [{mocap}, {DEAD_RECKONING}]"))


@valid
def cascade_for_a_calm_flight(mission: Mission) -> Changes:
    """Every vehicle with an on-board attitude loop may fly with `cascade`."""
    if mission.name in ("first_flight", "teleoperation", "joystick", "fallback", "cross_traffic"):
        yield from _tracker(mission, "cascade")


@valid
def gentler_landing(mission: Mission) -> Changes:
    """It slows down a little higher above the ground."""
    yield from _states(mission, "slow_below", "50 cm", "land")


@valid
def perfect_lab(mission: Mission) -> Changes:
    """Still air and exact markers make a simulation easier."""
    if mission.name in ("first_flight", "sidestep", "trajectory", "fallback", "courier"):
        yield from _in_simulation(mission, "calm: true", tags=True)


@valid
def breeze_from_the_west(mission: Mission) -> Changes:
    """Every airframe holds its place in half a metre per second."""
    yield from _in_simulation(mission, "wind: [0.5, 0, 0]", tags=True)


@valid
def earlier_battery_alarm(mission: Mission) -> Changes:
    """A pilot may want to be warned at 35 % and to land at 20 %."""
    yield from _supervisors(mission, "{use: battery, warn_below: 35 %, land_below: 20 %}")


@valid
def tighter_tilt_alarm(mission: Mission) -> Changes:
    """The documentation's own example."""
    yield from _supervisors(mission, "{use: tilt, limit: 45 deg, reaction: land_blind}")


@valid
def written_default_processors(mission: Mission) -> Changes:
    """The list says what every vehicle has, with another margin."""
    if "survey" not in mission.name:
        yield from _processors(mission, fence="{use: fence, margin: 15 cm}")


@valid
def cupboard_in_a_corner(mission: Mission) -> Changes:
    """An obstacle in a corner of the room where nobody flies."""
    corner = _free_corner(mission)
    if corner:
        x, y, _ = corner
        box = f"{{from: [{x - 0.3:g}, {y - 0.3:g}, 0], to: [{x:g}, {y:g}, 1.8]}}"
        yield change(_obstacle(mission, f"armario: {{box: {box}}}"))


@valid
def parcel_on_the_floor_of_a_corner(mission: Mission) -> Changes:
    """An object that stands where nobody flies."""
    corner = _free_corner(mission)
    if corner:
        at = f"[{corner[0] - 0.3:g}, {corner[1] - 0.3:g}, 10 cm]"
        entry = f"kiste: {{at: {at}, size: [30 cm, 30 cm, 30 cm], mass: 2 kg}}"
        yield change(_object(mission, entry))


@valid
def height_as_a_parameter(mission: Mission) -> Changes:
    """The take-off's height gets a name, and keeps its value."""
    for state in mission.states("take_off")[:1]:
        height = mission.at("height", of=state.node)
        written = mission.written(height)
        if height and written and not mission.at("parameters", "rise"):
            entry = f"rise: {{type: length, default: {written}, help: Steighöhe.}}"
            yield change(own_section(mission, "parameters", entry), put(height, "$rise"))


@valid
def speeds_per_hour(mission: Mission) -> Changes:
    """km/h is a unit of speeds."""
    for state in mission.states("circle", "follow_path", "steer", "fly_to"):
        speed = mission.written(mission.at("speed", of=state.node))
        if speed and speed.unit == "m/s":
            text = f"{speed.number * 3.6:g} km/h"
            yield change(with_key(mission, state.node, "speed", text))


@valid
def one_more_bound_on_the_tilt(mission: Mission) -> Changes:
    """The vehicles lean by less than 45 degrees."""
    for vehicle in _named(mission):
        if not mission.at("faults"):
            item = f"max({vehicle.name}.state.tilt) < 45 deg"
            yield change(own_list(mission, "expect", item))


@valid
def all_of_a_group_land(mission: Mission) -> Changes:
    """A new group is used by an expectation."""
    if mission.name in ("sidestep", "figure_eight"):
        names = ", ".join(v.name for v in mission.vehicles())
        edits = (
            own_section(mission, "groups", f"tutti: [{names}]"),
            own_list(mission, "expect", "finally all tutti in landed"),
        )
        yield change(*edits)


@valid
def leaves_with_an_event_of_its_own(mission: Mission) -> Changes:
    """A transition by time emits an event that a callback logs."""
    for state in mission.states("hover"):
        then = mission.word("then", of=state.node)
        time = mission.written(mission.at("for_time", of=state.node))
        if then and time and mission.name in ("first_flight", "sidestep", "trajectory"):
            text = f"{{do: hover, next: [{{after: {time}, emit: pronto, go: {then}}}]}}"
            yield change(put(state.node, text), _on(mission, "pronto", '{log: "via"}'))


@valid
def person_may_end_the_run(mission: Mission) -> Changes:
    """A callback waits for a person's event, which need not come."""
    yield change(_on(mission, "operator.genug", '{stop: "genug"}'))


@valid
def home_beside_the_start(mission: Mission) -> Changes:
    """`go_home` may end beside the start, where it is free."""
    if mission.name == "joystick":
        for vehicle in mission.own():
            yield change(add(vehicle.node, "home: [0.4, 0.4, 0]"))


@valid
def clockwise_round(mission: Mission) -> Changes:
    """A negative speed flies a circle clockwise."""
    if mission.name in ("fallback", "joystick"):
        for state in mission.states("circle"):
            speed = mission.at("speed", of=state.node)
            if speed:
                yield change(put(speed, f"-{speed.value}"))


@valid
def losses_that_the_estimator_bridges(mission: Mission) -> Changes:
    """A tenth of a second without poses is less than what `healthy` allows."""
    for vehicle in _first(mission):
        if mission.name in ("first_flight", "sidestep", "follow_leader", "mass_pickup"):
            item = f"{{at: 7 s, on: {vehicle.name}, inject: mocap_dropout, for: 100 ms}}"
            yield change(own_list(mission, "faults", item))


@valid
def one_hundred_ticks_a_second(mission: Mission) -> Changes:
    """A usual control rate."""
    yield change(_top(mission, "control", "100 Hz"))


@valid
def keyboard_for_those_without_a_gamepad(mission: Mission) -> Changes:
    """Another target takes its input from the keys; letters that steer are left alone."""
    if mission.name == "joystick":
        stick = "{use: keyboard, buttons: {take: t, give: g, land: l}}"
        entry = f"tasten: {{all: {{driver: sim}}, inputs: {{stick: {stick}}}}}"
        yield change(own_section(mission, "targets", entry))


@valid
def gives_way_instead_of_stopping(mission: Mission) -> Changes:
    """`avoid_obstacles` in place of the guard, behind the limits and before the fence."""
    if mission.name in ("windy", "sidestep", "formation"):
        yield from _processors(mission, obstacle_guard="{use: avoid_obstacles, keep: 15 cm}")
