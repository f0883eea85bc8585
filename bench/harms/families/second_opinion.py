"""What somebody who knows only the documentation expects to be told of, and what not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

import yaml

from harms.mission_text import (
    Edit,
    Mission,
    Node,
    State,
    Vehicle,
    add,
    add_last,
    append,
    own_list,
    own_section,
    put,
    with_key,
)
from harms.operator import Changes, change, dangerous, senseless, valid

STEERED = ("steer",)
FOLLOWING = ("formation", "follow")
SIDEWAYS = ("fly_to", "follow_path", "circle", "figure_eight", "follow_trajectory")


def _states(mission: Mission, parts: tuple[str, ...], *without: str) -> Iterator[State]:
    """The states of these parts that don't have these keys."""
    for state in mission.states(*parts):
        if not any(mission.at(key, of=state.node) for key in without):
            yield state


def _transitions(mission: Mission, of: Node) -> list[Node]:
    return [n for n in mission.items("next", of=of) if isinstance(n, yaml.MappingNode)]


def _once_up(mission: Mission, vehicle: str, *actions: str) -> Edit:
    """A callback acts when the vehicle is in the air."""
    return own_list(mission, "on", f"{{event: {vehicle}.took_off, do: [{', '.join(actions)}]}}")


def _set_once_up(mission: Mission, option: str, value: str, *parts: str) -> Changes:
    """A callback sets an option of a vehicle that has a state of these parts."""
    names = {state.vehicle for state in mission.states(*parts)}
    for vehicle in mission.own():
        if vehicle.name in names:
            action = f"{{set: {{{vehicle.name}.{option}: {value}}}}}"
            yield change(_once_up(mission, vehicle.name, action))


def _size(mission: Mission, axis: int) -> float:
    """The size of the mission's room; none where a library has it."""
    corners = [mission.items("world", "fence", key) for key in ("from", "to")]
    if not all(corners):
        return 0.0
    low, high = (mission.quantity(corner[axis]) for corner in corners)
    assert low is not None
    assert high is not None
    return high.number - low.number


def _in_simulation(mission: Mission, parameter: str) -> Changes:
    """The simulator has one more parameter."""
    driver = mission.at("targets", "sim", "all", "driver")
    if driver:
        yield change(add_last(driver, parameter))
    elif not mission.at("targets", "sim"):
        entry = f"sim: {{all: {{driver: {{use: sim, {parameter}}}}}}}"
        yield change(own_section(mission, "targets", entry))


def _obstacle(mission: Mission, entry: str) -> Edit:
    obstacles = mission.at("world", "obstacles")
    world = mission.at("world")
    assert world is not None
    return add(obstacles, entry) if obstacles else add(world, f"obstacles: {{{entry}}}")


def _has_own_world(mission: Mission) -> bool:
    return mission.at("world", "fence") is not None


def _uses_mocap(mission: Mission, vehicle: Vehicle) -> bool:
    return mission.word("like", of=vehicle.node).startswith("std.")


def _replaced(mission: Mission, old: str, new: str) -> tuple[Edit, ...]:
    """A name becomes another one wherever it stands for itself, below the summary."""
    begin = mission.text.index("\nsummary:") + 1
    begin = mission.text.index("\n", begin)
    name = re.compile(rf"(?<![\w./$]){old}(?!\w|\.yaml|\.csv)")
    return tuple(Edit(m.start(), m.end(), new) for m in name.finditer(mission.text, begin))


# Inputs and steering


@dangerous
def silence_noticed_minutes_later(mission: Mission) -> Changes:
    """A controller that has fallen silent steers on with its last values while it is steered."""
    for _, node in mission.pairs("inputs"):
        silence = mission.at("silent_after", of=node)
        if silence:
            yield change(put(silence, "300 s"))


@dangerous
def lost_input_steers_again(mission: Mission) -> Changes:
    """A lost controller leads back to steering by it: the vehicle hangs in the air."""
    for state in _states(mission, STEERED):
        yield change(with_key(mission, state.node, "failed", state.name))


@dangerous
def one_stick_axis_steers_two(mission: Mission) -> Changes:
    """Who pushes the right stick to the left also turns the vehicle, which then flies elsewhere."""
    for name, target in mission.pairs("targets"):
        for _, node in mission.pairs("inputs", of=target):
            if mission.word("use", of=node) == "gamepad":
                yield change(add(node, "turn: -right_x"), target=name.value)


@dangerous
def waits_an_hour_for_a_hand(mission: Mission) -> Changes:
    """Without a person the vehicle hovers until its battery is low, or until the time limit."""
    for state in mission.states("hover"):
        for item in _transitions(mission, state.node):
            after = mission.at("after", of=item)
            if after:
                yield change(put(after, "60 min"))


@senseless
def steers_at_a_crawl(mission: Mission) -> Changes:
    """A full stick moves the vehicle by six centimetres a minute: it can't be steered."""
    for state in _states(mission, STEERED):
        yield change(with_key(mission, state.node, "speed", "1 mm/s"))


@senseless
def no_room_to_steer_in(mission: Mission) -> Changes:
    """The distance that steering keeps from the fence is more than half the room."""
    size = _size(mission, 0)
    for state in _states(mission, STEERED) if size else ():
        margin = f"{size / 2 + 0.5:g} m"
        fence = mission.at("world", "fence")
        yield change(with_key(mission, state.node, "margin", margin), also=(fence,))


@senseless
def lowest_above_the_ceiling(mission: Mission) -> Changes:
    """The vehicle is to be steered higher than the fence allows."""
    size = _size(mission, 2)
    for state in mission.states("steer", "formation") if size else ():
        if mission.at("input", of=state.node):
            lowest = f"{size + 0.5:g} m"
            fence = mission.at("world", "fence")
            yield change(with_key(mission, state.node, "lowest", lowest), also=(fence,))


@senseless
def held_stick_counts_as_stuck(mission: Mission) -> Changes:
    """A stick that is held for a tenth of a second counts as lost: nobody can steer like that."""
    for _, node in mission.pairs("inputs"):
        yield change(add_last(node, "stuck_after: 100 ms"))


@senseless
def dead_man_gives_back(mission: Mission) -> Changes:
    """The button that must be held to steer ends the steering when it is pressed."""
    for _, node in mission.pairs("inputs"):
        given, held = mission.at("buttons", "give", of=node), mission.at("dead_man", of=node)
        if given and isinstance(held, yaml.ScalarNode):
            yield change(put(given, held.value), also=(held,))


@senseless
def button_that_the_script_never_presses(mission: Mission) -> Changes:
    """A state waits for a button that the recorded operator never presses."""
    scripts = [
        key.value
        for key, node in mission.pairs("inputs")
        if mission.word("use", of=node) == "script"
    ]
    for state in mission.states("hover", "steer"):
        for item in _transitions(mission, state.node):
            event = mission.at("event", of=item)
            source = mission.word("event", of=item).split(".")[0]
            if event and source in scripts:
                yield change(put(event, f"{source}.thumb"))


@senseless
def second_wait_for_one_event(mission: Mission) -> Changes:
    """Two transitions wait for one event: the second is never taken."""
    owners = [s.node for s in mission.states()] + [phase for _, phase in mission.phases()]
    for owner in owners:
        events = [mission.at("event", of=item) for item in _transitions(mission, owner)]
        both = [e for e in events if isinstance(e, yaml.ScalarNode)]
        if len(both) > 1:
            yield change(put(both[1], both[0].value), also=(both[0],))


# Formations


@dangerous
def two_places_are_one(mission: Mission) -> Changes:
    """Two members of the formation have the same place."""
    for state in mission.states("formation"):
        points = mission.items("points", of=state.node)
        if len(points) > 1:
            first = points[0]
            text = mission.text[first.start_mark.index : first.end_mark.index]
            yield change(put(points[1], text), also=(first,))


@dangerous
def they_chase_each_other(mission: Mission) -> Changes:
    """One follows a member of the formation that follows it, at offsets that can't both hold."""
    for one in mission.states("follow"):
        for other in mission.states("formation"):
            leader = mission.at("leader", of=other.node)
            vehicle = mission.at("vehicle", of=one.node)
            if leader and vehicle:
                yield change(put(vehicle, other.vehicle), put(leader, one.vehicle))


@senseless
def messages_older_than_fresh(mission: Mission) -> Changes:
    """Every message is older than the age at which its sender counts as silent."""
    for state in mission.states(*FOLLOWING):
        delay = mission.at("delay", of=state.node)
        if delay:
            yield change(put(delay, "350 ms"))


@senseless
def follows_within_its_clearance(mission: Mission) -> Changes:
    """The place beside the leader is closer than the distance that is kept from it."""
    for state in _states(mission, ("follow",), "clearance"):
        offset = mission.at("offset", of=state.node)
        if offset:
            yield change(put(offset, "[0, 0.4, 0]"))


@senseless
def one_place_is_missing(mission: Mission) -> Changes:
    """The formation has fewer places than members."""
    for state in mission.states("formation"):
        points = mission.items("points", of=state.node)
        if len(points) > 2:
            yield change(Edit(points[-2].end_mark.index, points[-1].end_mark.index, ""))


@senseless
def only_one_forms_up(mission: Mission) -> Changes:
    """One vehicle enters the formation and waits in vain for the other members."""
    for name, phase in mission.phases():
        for key, state in mission.pairs("run", of=phase):
            group = mission.items("groups", key.value)
            forms = [s for s in mission.states("formation") if s.name == state.value]
            # `again` of swarm_teleoperation brings back three while the fourth is on its way
            if group and forms and name != "again":
                also = tuple(node for s in forms for node in (s.key, s.node))
                yield change(put(key, group[0].value), also=also)


@senseless
def formation_climbs_a_millimetre_a_second(mission: Mission) -> Changes:
    """The path of the formation climbs by decimetres, which takes longer than the phase lasts."""
    for state in _states(mission, ("formation",), "climb"):
        heights = {
            quantity.number
            for point in mission.items("path", of=state.node)
            if (quantity := mission.quantity(point.value[2]))
        }
        if len(heights) > 1 and max(heights) - min(heights) >= 0.3:
            yield change(add_last(state.node, "climb: 1 mm/s"))


@senseless
def formation_on_the_fence(mission: Mission) -> Changes:
    """The formation begins around a point in the fence: half of its places are outside."""
    for state in _states(mission, ("formation",), "center", "leader"):
        fence = mission.at("world", "fence")
        corner = mission.items("world", "fence", "to")
        edge = mission.quantity(corner[0]) if corner else None
        if edge:
            center = f"center: [{edge.number:g}, 0, 1.2]"
            yield change(add_last(state.node, center), also=(fence,))


@senseless
def every_error_stops_the_formation(mission: Mission) -> Changes:
    """The members wait for each other at a tenth of a millimetre, which no vehicle can hold."""
    for state in _states(mission, ("formation",), "doubt"):
        yield change(add_last(state.node, "doubt: 0.1 mm"))


@senseless
def group_names_one_twice(mission: Mission) -> Changes:
    """A group lists a vehicle twice, in the place of another one or in addition."""
    for key, group in mission.pairs("groups"):
        yield change(append(group, group.value[0].value), also=(key,))


# Avoidance and obstacles


def _avoiding(mission: Mission) -> Iterator[tuple[Vehicle, list[Node], int]]:
    """Vehicles with `avoid_obstacles`, their processors and which of them it is."""
    for vehicle in mission.own():
        items = mission.items("processors", of=vehicle.node)
        for index, item in enumerate(items):
            if mission.word("use", of=item) == "avoid_obstacles":
                yield vehicle, items, index


@dangerous
def avoids_one_of_eight(mission: Mission) -> Changes:
    """Eight fly through one point, and all but one of them are not avoided."""
    for vehicle, items, index in _avoiding(mission):
        if len(mission.vehicles()) > 2:
            yield change(add_last(items[index], f"treat_as_obstacles: [{vehicle.name}]"))


@dangerous
def avoids_one_of_eight_from_a_phase_on(mission: Mission) -> Changes:
    """In the phase in which all fly through one point all but one of them are not avoided."""
    if len(mission.vehicles()) > 2 and any(_avoiding(mission)):
        for name, phase in mission.phases():
            option = "swarm.processors.avoid_obstacles.treat_as_obstacles"
            if name == "cross":
                yield change(add(phase, f"set: {{{option}: [a]}}"))


@dangerous
def avoidance_off_once_up(mission: Mission) -> Changes:
    """Vehicles whose ways cross in one point, or lead through a heap, no longer avoid it."""
    names = [vehicle.name for vehicle in mission.vehicles()]
    for vehicle, _, _ in _avoiding(mission):
        goes_through = any(s.vehicle == vehicle.name for s in mission.states("fly_to"))
        own = names if len(names) > 2 else [vehicle.name]
        actions = [f"{{disable: {name}.processors.avoid_obstacles}}" for name in own]
        if goes_through:
            yield change(_once_up(mission, vehicle.name, *actions))


@senseless
def keeps_further_than_the_room_is_wide(mission: Mission) -> Changes:
    """The vehicle keeps further from everything than there is room for."""
    for _, items, index in _avoiding(mission):
        keep = mission.at("keep", of=items[index])
        if keep:
            yield change(put(keep, "3 m"))


@dangerous
def shelf_above_the_start(mission: Mission) -> Changes:
    """A shelf hangs above the start: the vehicle takes off into it."""
    if not _has_own_world(mission):
        return
    for vehicle in mission.own():
        at = mission.planned(vehicle.name).start
        low = f"[{at[0] - 0.3:g}, {at[1] - 0.3:g}, 0.7]"
        high = f"[{at[0] + 0.3:g}, {at[1] + 0.3:g}, 0.8]"
        entry = f"shelf: {{box: {{from: {low}, to: {high}}}}}"
        yield change(
            _obstacle(mission, entry), also=(vehicle.key, mission.at("start", of=vehicle.node))
        )


@dangerous
def ball_rolls_over_the_start(mission: Mission) -> Changes:
    """A moving ball rolls to and fro over the place where the vehicle stands."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        along = mission.at("moving_sphere", "along", of=obstacle)
        if along:
            vehicle = mission.own()[0]
            x, y = mission.planned(vehicle.name).start[:2]
            path = f"[[{x:g}, {y:g}, 0.1], [{x - 1:g}, {y:g}, 0.1]]"
            start = mission.at("start", of=vehicle.node)
            yield change(put(along, path), also=(start, vehicle.key))


@dangerous
def wall_faces_out_of_the_room(mission: Mission) -> Changes:
    """A wall faces the other way, so that the room itself is solid."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        facing = mission.at("plane", "facing", of=obstacle)
        if facing:
            axes = [-float(axis.value) for axis in facing.value]
            yield change(put(facing, f"[{', '.join(f'{a + 0.0:g}' for a in axes)}]"))


@dangerous
def scan_without_points(mission: Mission) -> Changes:
    """All points of the scan are below the height under which they are ignored: no obstacle."""
    for _, obstacle in mission.pairs("world", "obstacles"):
        cloud = mission.at("point_cloud", of=obstacle)
        above = mission.at("above", of=cloud) if cloud else None
        if cloud and above:
            yield change(put(above, "5 m"))
            yield change(add_last(cloud, "units: mm"))


@dangerous
def home_behind_the_fence(mission: Mission) -> Changes:
    """The home to which the vehicle flies when steering fails lies metres outside the fence."""
    for state in mission.states("go_home"):
        vehicle = next(v for v in mission.vehicles() if v.name == state.vehicle)
        fence = mission.at("world", "fence")
        yield change(add(vehicle.node, "home: [9, 0, 0]"), also=(state.node, state.key, fence))


@dangerous
def home_inside_a_pillar(mission: Mission) -> Changes:
    """Home is inside an obstacle, which the vehicle flies at to land there."""
    for state in mission.states("go_home"):
        for key, obstacle in mission.pairs("world", "obstacles"):
            foot = mission.at("cylinder", "at", of=obstacle)
            if foot:
                vehicle = next(v for v in mission.vehicles() if v.name == state.vehicle)
                text = mission.text[foot.start_mark.index : foot.end_mark.index]
                also = (key, state.node, state.key)
                yield change(add(vehicle.node, f"home: {text}"), also=also)


# Flows and phases


@dangerous
def landing_phase_lands_one(mission: Mission) -> Changes:
    """The last phase lands one of the group; the others hang in the air until they are landed."""
    for name, phase in mission.phases():
        for key, state in mission.pairs("run", of=phase):
            members = mission.items("groups", key.value)
            is_last = not mission.at("next", of=phase)
            if members and is_last and state.value == "down" and name != "apart":
                yield change(put(key, members[0].value))


@dangerous
def late_phase_begins_again(mission: Mission) -> Changes:
    """If a vehicle doesn't arrive, the phase begins again for ever instead of landing all."""
    for name, phase in mission.phases():
        otherwise = mission.at("otherwise", of=phase)
        if otherwise and otherwise.value != name:
            yield change(put(otherwise, name))


@senseless
def phase_of_one_second(mission: Mission) -> Changes:
    """The phase is over before a vehicle can have done what it asks for."""
    for _, phase in mission.phases():
        within = mission.at("within", of=phase)
        if within and mission.at("run", of=phase):
            yield change(put(within, "1 s"))


@senseless
def waits_for_a_state_that_nobody_enters(mission: Mission) -> Changes:
    """The phase waits until all are in a state in which it has put none of them."""
    phases = dict(mission.phases())
    for phase in phases.values():
        for item in _transitions(mission, phase):
            when = mission.at("when", of=item)
            if when and re.fullmatch(r"all \w+ in hover", when.value):
                following = phases.get(mission.word("go", of=item))
                run = mission.at("run", of=following) if following else None
                yield change(put(when, when.value.replace("hover", "down")), also=(run,))


@senseless
def asks_one_that_it_gave_away(mission: Mission) -> Changes:
    """The phase gives a vehicle to another flow and asks something of it."""
    for _, phase in mission.phases():
        given = mission.pairs("give", of=phase)
        for key, _ in mission.pairs("run", of=phase) if given else ():
            if mission.at("groups", "swarm"):
                yield change(put(key, "swarm"), also=(mission.at("give", of=phase),))


@senseless
def together_without_a_pace(mission: Mission) -> Changes:
    """Behaviors that fly no straight line are to arrive at the same time."""
    for _, phase in mission.phases():
        asked = [state.value for _, state in mission.pairs("run", of=phase)]
        parts = {s.name for s in mission.states("circle", "formation", "take_off", "land")}
        straight = {s.name for s in mission.states("fly_to")}
        if asked and all(name in parts - straight for name in asked):
            yield change(add(phase, "arrive: together"))


# AR.Drones


def _drones(mission: Mission) -> Iterator[tuple[str, str, Node, Node]]:
    """Target, vehicle, its entry there and its driver, of AR.Drones."""
    for target, entries in mission.pairs("targets"):
        for vehicle, entry in mission.pairs(of=entries):
            driver = mission.at("driver", of=entry)
            if driver and mission.word("use", of=driver) == "ardrone":
                yield target.value, vehicle.value, entry, driver


@dangerous
def two_drones_with_one_address(mission: Mission) -> Changes:
    """One drone gets the commands of two vehicles, and another one none."""
    hosts = [(t, mission.at("host", of=driver)) for t, _, _, driver in _drones(mission)]
    for (_, first), (target, second) in pairwise(hosts):
        if first and second:
            yield change(put(second, first.value), also=(first,), target=target)


@dangerous
def flies_by_the_poses_of_another(mission: Mission) -> Changes:
    """A drone is controlled by the poses of another one's body."""
    drones = list(_drones(mission))
    for (_, other, entry, _), (target, _, own, _) in pairwise(drones):
        sensor = mission.at("sensors", "mocap", of=own)
        if sensor:
            yield change(add_last(sensor, f"body: {other}"), also=(entry,), target=target)


@senseless
def drone_that_may_not_climb_so_high(mission: Mission) -> Changes:
    """The drone itself stops climbing below the height of the mission."""
    for target, _, _, driver in _drones(mission):
        states = mission.states("take_off", "circle")
        also = (*(s.node for s in states), *(s.key for s in states))
        yield change(add_last(driver, "altitude_max: 0.7 m"), also=also, target=target)


@senseless
def commands_that_the_drone_does_not_know(mission: Mission) -> Changes:
    """The tracker gives attitudes and thrusts, and the drone takes tilts and climb rates."""
    for target, _, entry, driver in _drones(mission):
        yield change(add_last(entry, "tracker: cascade"), also=(driver,), target=target)


@senseless
def flip_without_permission(mission: Mission) -> Changes:
    """A callback asks for a flip, which the driver is not allowed to perform."""
    for target, vehicle, entry, driver in _drones(mission):
        edit = _once_up(mission, vehicle, f"{{perform: {{{vehicle}: flip_left}}}}")
        yield change(edit, also=(entry, driver), target=target)


@senseless
def inertial_sensors_not_sent(mission: Mission) -> Changes:
    """The estimator needs the IMU, which the short navigation data don't have."""
    own = {vehicle.name: vehicle for vehicle in mission.own()}
    for target, name, _, driver in _drones(mission):
        if name in own:
            estimators = add(own[name].node, "estimators: [{use: fusion, source: mocap}]")
            yield change(estimators, add_last(driver, "navdata: demo"), target=target)


# The lab's world and the drivers


@dangerous
def storm_in_the_lab(mission: Mission) -> Changes:
    """Gusts of 9 m/s, standard deviation, throw a light quadrotor out of the room."""
    driver = mission.at("targets", "sim", "all", "driver")
    gust = mission.at("gust", of=driver) if driver else None
    if gust and mission.written(gust):
        yield change(put(gust, "9 m/s"))
    elif not gust:
        yield from _in_simulation(mission, "gust: 9 m/s")


@senseless
def poses_three_times_a_second(mission: Mission) -> Changes:
    """Poses come a third of a second apart, and are trusted for a quarter of a second."""
    if all(_uses_mocap(mission, vehicle) for vehicle in mission.own()):
        yield from _in_simulation(mission, "mocap_rate: 3 Hz")


@senseless
def poses_half_a_second_late(mission: Mission) -> Changes:
    """Poses arrive after the age at which they are no longer trusted: it can't take off."""
    if all(_uses_mocap(mission, vehicle) for vehicle in mission.own()):
        yield from _in_simulation(mission, "mocap_latency: 500 ms")


@senseless
def no_watchdog_on_board(mission: Mission) -> Changes:
    """Without a watchdog on board the preflight never passes."""
    yield from _in_simulation(mission, "watchdog: false")


@senseless
def begins_with_an_empty_battery(mission: Mission) -> Changes:
    """The battery begins below the charge at which the vehicle lands."""
    yield from _in_simulation(mission, "battery: 12 %")


@senseless
def every_tag_is_covered(mission: Mission) -> Changes:
    """The vehicle navigates by tags, and all of them are covered."""
    for _, target in mission.pairs("targets"):
        for _, entry in mission.pairs(of=target):
            for _, sensor in mission.pairs("sensors", of=entry):
                covered = mission.at("covered", of=sensor)
                if covered:
                    yield change(put(covered, "100 %"))


# Options set in flight


@dangerous
def damping_gone_in_flight(mission: Mission) -> Changes:
    """A callback takes the damping from the position loop, which then swings ever more."""
    yield from _set_once_up(mission, "tracker.derivative", "0.1", *SIDEWAYS, "steer", "hover")


@dangerous
def tilt_taken_away_in_flight(mission: Mission) -> Changes:
    """A callback leaves a tenth of a degree of tilt: the vehicle can't follow nor hold."""
    yield from _set_once_up(mission, "tracker.tilt", "0.1 deg", *SIDEWAYS)


@dangerous
def tilt_alarm_in_flight(mission: Mission) -> Changes:
    """A callback sets the tilt alarm below what every motion needs: a blind landing."""
    yield from _set_once_up(mission, "supervisors.tilt.limit", "1 deg", *SIDEWAYS)


@dangerous
def age_alarm_in_flight(mission: Mission) -> Changes:
    """A callback allows estimates of a millisecond only; poses are ten old: a blind landing."""
    yield from _set_once_up(mission, "supervisors.estimate.age", "1 ms", *SIDEWAYS, "hover")


@dangerous
def error_alarm_in_flight(mission: Mission) -> Changes:
    """A callback allows a tenth of a millimetre of error: the vehicle brakes and stays there."""
    yield from _set_once_up(mission, "processors.position_error.limit", "0.1 mm", *SIDEWAYS)


@dangerous
def neighbours_alarm_in_flight(mission: Mission) -> Changes:
    """A callback asks for more distance than the room has: all brake in the air."""
    if len(mission.vehicles()) > 1:
        yield from _set_once_up(mission, "supervisors.proximity.distance", "9 m", *SIDEWAYS)


@senseless
def fence_margin_in_flight(mission: Mission) -> Changes:
    """A callback shrinks the fence by more than half the room."""
    if size := _size(mission, 0):
        margin = f"{size / 2 + 0.5:g} m"
        yield from _set_once_up(mission, "processors.fence.margin", margin, *SIDEWAYS)


@dangerous
def one_is_slowed_among_the_others(mission: Mission) -> Changes:
    """A phase slows one that circles with others to a millimetre a second: the next hits it."""
    for name, phase in mission.phases():
        for key, value in mission.pairs("set", of=phase):
            if key.value.endswith("limit_speed.speed") and name == "again":
                yield change(put(value, "1 mm/s"))


@senseless
def takes_off_again_whenever_it_lands(mission: Mission) -> Changes:
    """The vehicle is to take off again after each landing: the mission has no end."""
    for state in mission.states("take_off"):
        if len(mission.vehicles()) == 1:
            action = f"{{switch: {{{state.vehicle}: {state.name}}}}}"
            item = f"{{event: {state.vehicle}.landed, do: [{action}]}}"
            yield change(own_list(mission, "on", item), also=(state.key,))


@senseless
def stops_as_soon_as_it_flies(mission: Mission) -> Changes:
    """The run ends at the take-off: nothing of the mission is flown."""
    for vehicle in mission.own()[:1]:
        yield change(_once_up(mission, vehicle.name, "{stop: enough}"))


@senseless
def callback_above_the_ceiling(mission: Mission) -> Changes:
    """The callback waits for a height that is far above the fence."""
    for vehicle in mission.own()[:1]:
        when = f"{vehicle.name}.state.altitude > 40 m"
        item = f'{{when: {when}, do: [{{log: "high at {{time}}"}}]}}'
        yield change(own_list(mission, "on", item), also=(mission.at("world", "fence"),))


@senseless
def filter_that_never_fits(mission: Mission) -> Changes:
    """The callback is for a state that the vehicle doesn't have."""
    for item in mission.items("on"):
        behavior = mission.at("behavior", of=item)
        if behavior:
            yield change(put(behavior, "eihgt"))
    for vehicle in mission.own()[:1]:
        do = '[{log: "{vehicle} comes home"}]'
        item_text = f"{{event: {vehicle.name}.behavior_started, behavior: homing, do: {do}}}"
        yield change(own_list(mission, "on", item_text))


# Expectations


def _expect(mission: Mission, text: str, *also: Node | None) -> Changes:
    expect = mission.at("expect")
    if expect:
        yield change(append(expect, text), also=also)


@senseless
def expects_it_up_and_down(mission: Mission) -> Changes:
    """At the end the vehicle is to be landed and half a metre up."""
    for vehicle in mission.own():
        landed = mission.expectations(f"finally {vehicle.name} in landed")
        if landed:
            yield from _expect(mission, f"finally {vehicle.name}.state.altitude > 50 cm", landed[0])


@senseless
def expects_of_a_state_that_only_failures_reach(mission: Mission) -> Changes:
    """The expectation is of a state in which the vehicle is only after a failure."""
    for state in mission.states("land"):
        at = state.name
        nodes = [s.node for s in mission.states() if s.vehicle == state.vehicle]
        led = [mission.word("then", of=n) for n in nodes]
        led += [mission.word("go", of=t) for n in nodes for t in _transitions(mission, n)]
        asked = {s.value for _, p in mission.phases() for _, s in mission.pairs("run", of=p)}
        if at not in asked.union(led):
            text = f"max({state.vehicle}.state.speed in {at}) < 1 m/s"
            yield from _expect(mission, text, state.key)


@senseless
def expects_a_blind_landing_of_nothing(mission: Mission) -> Changes:
    """Nothing is broken in this mission, and a landing without a position is expected."""
    if not mission.at("faults"):
        for vehicle in mission.own()[:1]:
            yield from _expect(mission, f"eventually {vehicle.name} in land_blind")


@senseless
def expects_a_flight_on_the_floor(mission: Mission) -> Changes:
    """The vehicle takes off to a metre and is to stay below thirty centimetres."""
    for state in mission.states("take_off"):
        text = f"always {state.vehicle}.state.altitude < 30 cm"
        yield from _expect(mission, text, state.key, mission.at("height", of=state.node))


@senseless
def expects_it_never_to_stand(mission: Mission) -> Changes:
    """The vehicle stands on the ground at the start, and is to be fast all the time."""
    for vehicle in mission.own()[:1]:
        yield from _expect(mission, f"min({vehicle.name}.state.speed) > 20 cm/s")


@senseless
def expects_an_end_in_six_seconds(mission: Mission) -> Changes:
    """The mission can't be over when it is expected to be."""
    for node in mission.expectations("finished within"):
        yield change(put(node, "finished within 6 s"))


@senseless
def expects_two_in_one_place(mission: Mission) -> Changes:
    """Two vehicles that start far apart are to be twenty centimetres apart all the time."""
    own = mission.vehicles()
    if len(own) > 1:
        first, second = own[0].name, own[1].name
        yield from _expect(mission, f"always distance({first} to {second}) < 20 cm")


@senseless
def expects_what_is_always_so(mission: Mission) -> Changes:
    """No battery has less than nothing: the expectation says nothing."""
    for vehicle in mission.own()[:1]:
        yield from _expect(mission, f"always {vehicle.name}.battery.remaining >= 0 %")


# Faults


@dangerous
def parcel_heavier_than_the_lift(mission: Mission) -> Changes:
    """The parcel weighs more than the rotors can lift: the vehicle falls."""
    for item in mission.items("faults"):
        added = mission.at("added", of=item)
        if added:
            yield change(put(added, "4.6 kg"))


@dangerous
def storm_as_a_fault(mission: Mission) -> Changes:
    """The wind asks for more tilt than the vehicle may have: it is blown out of the room."""
    for item in mission.items("faults"):
        velocity = mission.at("velocity", of=item)
        if velocity and mission.word("inject", of=item) == "wind":
            yield change(put(velocity, "[25, 10, 0]"))


@dangerous
def rotor_stops(mission: Mission) -> Changes:
    """A rotor stops in the air, so that the vehicle falls, and it is expected to land."""
    for state in mission.states("hover", *SIDEWAYS):
        landed = mission.expectations(f"finally {state.vehicle} in landed")
        if landed and mission.at("faults"):
            when = f"{{when: behavior == {state.name}, on: {state.vehicle}, "
            item = f"{when}inject: rotor_weak, left: 0 %}}"
            yield change(own_list(mission, "faults", item), also=(landed[0],))


@senseless
def fault_after_its_state(mission: Mission) -> Changes:
    """The fault waits for longer than its state lasts."""
    for item in mission.items("faults"):
        when = mission.at("when", of=item)
        match = re.search(r"(\w+) and elapsed > \d+ s", when.value) if when else None
        hovers = [s for s in mission.states("hover") if match and s.name == match[1]]
        if when and hovers and mission.at("for_time", of=hovers[0].node):
            text = re.sub(r"elapsed > \d+ s", "elapsed > 90 s", when.value)
            also = tuple(s.key for s in hovers)
            yield change(put(when, text), also=also)


@senseless
def dark_camera_of_a_vehicle_without_one(mission: Mission) -> Changes:
    """The fault darkens the camera of a vehicle that has none."""
    for vehicle in mission.own():
        if _uses_mocap(mission, vehicle) and "ardrone" not in mission.word("like", of=vehicle.node):
            item = f"{{at: 6 s, on: {vehicle.name}, inject: camera_dark, for: 1 s}}"
            yield change(own_list(mission, "faults", item), also=(vehicle.key,))


@senseless
def nobody_hears_it_anyway(mission: Mission) -> Changes:
    """The fault loses messages to neighbours of a vehicle that is alone."""
    if len(mission.vehicles()) == 1:
        name = mission.own()[0].name
        item = f"{{at: 6 s, on: {name}, inject: neighbours_lost, for: 2 s}}"
        yield change(own_list(mission, "faults", item))


@senseless
def fault_that_breaks_nothing(mission: Mission) -> Changes:
    """The fault adds nothing to the mass, to the wind or to the IMU."""
    for vehicle in mission.own()[:1]:
        for fault in ("mass_change", "gust, velocity: [0, 0, 0]", "imu_bias_step"):
            item = f"{{at: 6 s, on: {vehicle.name}, inject: {fault}, for: 2 s}}"
            yield change(own_list(mission, "faults", item))


# Names and units


@senseless
def arrives_from_anywhere(mission: Mission) -> Changes:
    """Nine metres from the goal count as arrived, in a room of six."""
    for state in _states(mission, ("fly_to", "follow_path"), "tolerance"):
        yield change(add_last(state.node, "tolerance: 9 m"))


@senseless
def tolerance_above_the_height(mission: Mission) -> Changes:
    """Two metres of error count as arrived one metre up: the tolerance says nothing."""
    for state in _states(mission, ("take_off",), "tolerance"):
        yield change(add_last(state.node, "tolerance: 2 m"))


@senseless
def stays_longer_than_it_may(mission: Mission) -> Changes:
    """The vehicle is to stay at the goal for minutes, and fails after seconds."""
    for state in _states(mission, ("fly_to",), "dwell"):
        within = mission.at("within", of=state.node)
        if within:
            yield change(add_last(state.node, "dwell: 5 min"), also=(within,))


@senseless
def turns_to_no_heading(mission: Mission) -> Changes:
    """The rate of turning is given, but no heading to turn to."""
    for state in _states(mission, ("fly_to", "follow_path"), "heading", "turn_rate"):
        yield change(add_last(state.node, "turn_rate: 20 deg/s"))


# Estimators


def _with_estimators(mission: Mission, text: str) -> Changes:
    """A vehicle with motion capture lists its estimators itself."""
    for vehicle in mission.own():
        like = mission.word("like", of=vehicle.node)
        if like in ("std.nano_plus", "std.mk_quadro") and not mission.at(
            "estimators", of=vehicle.node
        ):
            yield change(add(vehicle.node, f"estimators: {text}"))


@senseless
def never_young_enough(mission: Mission) -> Changes:
    """No pose is as young as the condition wants it: the estimator is never used."""
    yield from _with_estimators(mission, "[{use: mocap, healthy: age < 2 ms}]")


@senseless
def healthy_when_it_is_bad(mission: Mission) -> Changes:
    """The estimate counts as healthy only if it is uncertain: it can never be used."""
    yield from _with_estimators(mission, "[{use: mocap, healthy: age < 250 ms and spread > 5 cm}]")


@senseless
def only_dead_reckoning(mission: Mission) -> Changes:
    """Dead reckoning alone never knows where it is: the vehicle can't take off."""
    yield from _with_estimators(mission, "[{use: inertial, for_at_most: 3 s}]")


@dangerous
def fallback_comes_first(mission: Mission) -> Changes:
    """Dead reckoning comes before motion capture, which is there all the time."""
    text = "[{use: inertial, for_at_most: 3 s}, {use: mocap, healthy: age < 250 ms}]"
    yield from _with_estimators(mission, text)


@dangerous
def spread_alarm_below_the_noise(mission: Mission) -> Changes:
    """The alarm's bound is far below the noise of motion capture: a blind landing."""
    for vehicle in mission.own():
        if _uses_mocap(mission, vehicle) and not mission.at("supervisors", of=vehicle.node):
            text = "supervisors: [{use: estimate, spread: 0.001 mm}]"
            yield change(add(vehicle.node, text))


# Missions that are as sensible as before


def _renamed_vehicle(mission: Mission, name: str) -> Changes:
    for vehicle in mission.vehicles():
        if vehicle.name in ("nano", "scout", "lead", "wing", "well", "steered", "courier"):
            yield change(*_replaced(mission, vehicle.name, name))


@valid
def vehicle_named_gull_in_german(mission: Mission) -> Changes:
    """A German lab calls its vehicle by a German word."""
    yield from _renamed_vehicle(mission, "möwe")


@valid
def vehicle_named_after_a_tale(mission: Mission) -> Changes:
    """A vehicle has a proper name, with a capital letter and an umlaut."""
    yield from _renamed_vehicle(mission, "Hänsel")


@valid
def vehicle_named_in_japanese(mission: Mission) -> Changes:
    """A Japanese lab calls its vehicle by a Japanese word."""
    yield from _renamed_vehicle(mission, "ドローン")


@valid
def state_named_in_greek(mission: Mission) -> Changes:
    """A state has a Greek name."""
    for name in ("steady", "clover", "eight", "wait", "drop", "grid", "rings", "loaded", "carry"):
        if any(state.name == name for state in mission.states()):
            yield change(*_replaced(mission, name, "πτήση"))


@valid
def group_named_in_chinese(mission: Mission) -> Changes:
    """A group has a Chinese name."""
    for key, _ in mission.pairs("groups"):
        if key.value in ("swarm", "everyone", "followers", "trio"):
            yield change(*_replaced(mission, key.value, "机群"))


@valid
def obstacle_named_in_french(mission: Mission) -> Changes:
    """An obstacle that nothing else names has a French name."""
    for key, _ in mission.pairs("world", "obstacles"):
        if mission.text.count(key.value) == 1:
            yield change(put(key, "meuble_à_éviter"))


@valid
def circles_the_other_way(mission: Mission) -> Changes:
    """All circle clockwise instead of counter-clockwise."""
    circles = mission.states("circle")
    if mission.name in ("three_ardrones", "joystick", "fallback") and circles:
        speed = mission.at("speed", of=circles[0].node)
        if speed:
            yield change(put(speed, f"-{speed.value}"))


@valid
def longer_take_off(mission: Mission) -> Changes:
    """The take-off has some seconds more until it fails."""
    for state in mission.states("take_off"):
        within = mission.at("within", of=state.node)
        if within:
            yield change(put(within, "19 s"))


@valid
def landings_are_logged(mission: Mission) -> Changes:
    """A callback writes when a vehicle has landed."""
    yield change(own_list(mission, "on", '{event: any.landed, do: [{log: "{vehicle}: {time}"}]}'))


@valid
def millimetres_for_metres(mission: Mission) -> Changes:
    """The height of the take-off is the same in another unit."""
    for state in mission.states("take_off"):
        height = mission.at("height", of=state.node)
        quantity = mission.written(height)
        if height and quantity and quantity.unit == "m":
            yield change(put(height, f"{1000 * quantity.number:g} mm"))


@valid
def dead_reckoning_as_a_fallback(mission: Mission) -> Changes:
    """A vehicle has the fallback for lost poses that the documentation recommends."""
    first = "{use: mocap, healthy: age < 250 ms and spread < 5 cm, recover_after: 1 s}"
    second = "{use: inertial, healthy: spread < 30 cm, for_at_most: 3 s}"
    yield from _with_estimators(mission, f"[{first}, {second}]")


@valid
def earlier_battery_warning(mission: Mission) -> Changes:
    """A vehicle warns of its battery earlier, and lands earlier."""
    for vehicle in mission.own():
        is_drone = "ardrone" in mission.word("like", of=vehicle.node)
        if not is_drone and not mission.at("supervisors", of=vehicle.node):
            text = "supervisors: [{use: battery, warn_below: 40 %, land_below: 20 %}]"
            yield change(add(vehicle.node, text))


@valid
def tells_it_in_other_words(mission: Mission) -> Changes:
    """The summary is written in Russian."""
    summary = mission.at("summary")
    if summary:
        yield change(put(summary, "Взлёт, полёт и посадка."))
