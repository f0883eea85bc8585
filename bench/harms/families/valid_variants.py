"""Sensible changes: another mission of which nothing may be said."""

from __future__ import annotations

import re

import yaml

from harms.families.avoidance import AVOID, tuned, with_ball
from harms.families.formations import acts, arriving, told
from harms.mission_text import (
    Edit,
    Mission,
    Node,
    State,
    add,
    own_list,
    own_section,
    put,
)
from harms.operator import Changes, change, valid

_BOUND = re.compile(r"(max|mean|rms)\((.*)\) < ([\d.]+) (.*)")


def _used(mission: Mission, *parts: str) -> list[State]:
    """States whose vehicle no other one shares or is like."""
    return [s for s in mission.states(*parts) if mission.at("flows") is None]


def _own_number(mission: Mission, state: State, key: str, factor: float) -> Edit | None:
    node = mission.at(key, of=state.node)
    quantity = mission.written(node)
    if node is None or quantity is None:
        return None
    return put(node, f"{round(quantity.number * factor, 4):g} {quantity.unit}".strip())


def _scaled(mission: Mission, key: str, factor: float, *parts: str) -> Changes:
    for state in mission.states(*parts):
        edit = _own_number(mission, state, key, factor)
        if edit is not None:
            yield change(edit)


@valid
def a_tenth_higher(mission: Mission) -> Changes:
    """It takes off to a tenth more than before."""
    yield from _scaled(mission, "height", 1.1, "take_off")


@valid
def a_little_lower(mission: Mission) -> Changes:
    """It takes off to a fifth less than before."""
    yield from _scaled(mission, "height", 0.8, "take_off")


@valid
def a_fifth_slower(mission: Mission) -> Changes:
    """It flies a fifth slower than before; where hands lead it then, is another matter."""
    yield from _scaled(mission, "speed", 0.8, "circle", "fly_to", "follow_path")


@valid
def a_smaller_circle(mission: Mission) -> Changes:
    """A circle a tenth smaller, around the same centre."""
    if mission.at("flows") is None:
        yield from _scaled(mission, "radius", 0.9, "circle")


@valid
def one_more_lap(mission: Mission) -> Changes:
    """One lap more, with the time to finish it."""
    for state in mission.states("circle", "figure_eight"):
        laps = mission.at("laps", of=state.node)
        finished = mission.expectations("finished")
        if laps is not None and finished and mission.at("flows") is None:
            later = put(finished[0], "finished within 120 s")
            yield change(put(laps, str(int(laps.value) + 1)), later)


@valid
def a_longer_hover(mission: Mission) -> Changes:
    """A hover of two seconds more."""
    for state in mission.states("hover"):
        time = mission.written(mission.at("for_time", of=state.node))
        node = mission.at("for_time", of=state.node)
        if time is not None and node is not None and time.number < 10:
            yield change(put(node, f"{time.number + 2:g} {time.unit}"))


@valid
def a_longer_within(mission: Mission) -> Changes:
    """Twice the time for a behavior."""
    yield from _scaled(mission, "within", 2.0)


@valid
def a_slower_eight(mission: Mission) -> Changes:
    """A lap of 12 s in place of 10 s, by its default."""
    lap = mission.at("parameters", "lap", "default")
    if lap is not None:
        yield change(put(lap, "12 s"))


@valid
def another_unit_of_the_same_length(mission: Mission) -> Changes:
    """`100 cm` for `1 m`."""
    for state in mission.states():
        for key, node in mission.pairs(of=state.node):
            quantity = mission.written(node) if key.value in ("height", "width", "radius") else None
            if quantity is not None and quantity.unit == "m":
                yield change(put(node, f"{round(100 * quantity.number, 3):g} cm"))


@valid
def another_unit_of_the_same_time(mission: Mission) -> Changes:
    """`3000 ms` for `3 s`."""
    for state in mission.states():
        for key, node in mission.pairs(of=state.node):
            quantity = mission.written(node) if key.value in ("within", "for_time") else None
            if quantity is not None and quantity.unit == "s":
                yield change(put(node, f"{1000 * quantity.number:g} ms"))


@valid
def bare_numbers(mission: Mission) -> Changes:
    """`1` for `1 m`: a bare number is SI."""
    for state in mission.states():
        for key, node in mission.pairs(of=state.node):
            quantity = mission.written(node) if key.value in ("height", "for_time") else None
            if quantity is not None and quantity.unit in ("m", "s"):
                yield change(put(node, f"{quantity.number:g}"))


@valid
def points_with_units(mission: Mission) -> Changes:
    """`[1 m, 0 m, 1 m]` for `[1, 0, 1]`."""
    for state in mission.states("fly_to", "circle"):
        node = mission.at("position", of=state.node) or mission.at("center", of=state.node)
        if isinstance(node, yaml.SequenceNode) and all("$" not in n.value for n in node.value):
            yield change(put(node, f"[{', '.join(f'{n.value} m' for n in node.value)}]"))


@valid
def a_comment(mission: Mission) -> Changes:
    """A comment behind a line, with a comma and a colon in it."""
    for state in mission.states("take_off"):
        end = mission.text.find("\n", state.node.end_mark.index)
        yield change(Edit(end, end, "  # up to 1,5 m: as agreed"))


@valid
def a_blank_line(mission: Mission) -> Changes:
    """A blank line before a section."""
    for key, _ in mission.root.value[2:]:
        index = mission.text.rfind("\n", 0, key.start_mark.index) + 1
        yield change(Edit(index, index, "\n"))


@valid
def another_summary(mission: Mission) -> Changes:
    """Another summary, with words of the language in it."""
    summary = mission.at("summary")
    if summary is not None:
        yield change(
            put(summary, '"What I fly on Mondays: take off, then land; 1,5 times as far."')
        )


@valid
def a_state_renamed(mission: Mission) -> Changes:
    """A state has another name, everywhere."""
    for state in mission.states():
        pattern = re.compile(rf"(?<![\w$.]){re.escape(state.name)}(?!\w)")
        places = list(pattern.finditer(mission.text))
        is_plain = len(state.name) > 3 and state.name not in _other_words(mission)
        if is_plain:
            yield change(*(Edit(m.start(), m.end(), f"{state.name}_2") for m in places))


def _other_words(mission: Mission) -> set[str]:
    """What stands in the text beside the names of states: keys, parts, prose and vehicles."""
    words = set(re.findall(r"\w+", f"{mission.word('summary')} {mission.name}"))
    words |= {do for s in mission.states() for do in re.findall(r"\w+", s.do)}
    words |= set(re.findall(r"\w+", "\n".join(re.findall(r"#.*|help: .*", mission.text))))
    words |= {"hover", "land", "circle", "inputs", "hand", "lap"} | {
        v.name for v in mission.vehicles()
    }
    return words | {key.value for key, _ in mission.root.value}


@valid
def keys_in_another_order(mission: Mission) -> Changes:
    """The transition before the parameters: the order of keys means nothing."""
    for state in mission.states():
        pairs = mission.pairs(of=state.node)
        if state.node.flow_style and len(pairs) > 2:
            texts = [mission.text[k.start_mark.index : v.end_mark.index] for k, v in pairs]
            yield change(put(state.node, f"{{{', '.join([texts[0], *texts[:0:-1]])}}}"))


@valid
def a_block_for_braces(mission: Mission) -> Changes:
    """A state in lines of its own, in place of braces."""
    for state in mission.states():
        pairs = mission.pairs(of=state.node)
        first = mission.text.rfind("\n", 0, state.key.start_mark.index) + 1
        margin = mission.text[first : state.key.start_mark.index]
        if state.node.flow_style and not margin.strip() and not _in_braces(mission, state):
            texts = [mission.text[k.start_mark.index : v.end_mark.index] for k, v in pairs]
            yield change(put(state.node, "".join(f"\n{margin}  {text}" for text in texts)))


def _in_braces(mission: Mission, state: State) -> bool:
    behaviors = mission.at("vehicles", state.vehicle, "behaviors")
    return behaviors is None or bool(behaviors.flow_style)


@valid
def the_other_airframe(mission: Mission) -> Changes:
    """Another airframe of the library flies it, where it flies slowly and in the open."""
    names = {"std.nano_plus": "std.mk_quadro", "std.mk_quadro": "std.nano_plus"}
    is_open = mission.at("world", "obstacles") is None and len(mission.vehicles()) == 1
    for vehicle in mission.own():
        like = mission.at("like", of=vehicle.node)
        if like is not None and like.value in names and is_open and mission.name != "mass_pickup":
            yield change(put(like, names[like.value]))


@valid
def the_other_fitting_tracker(mission: Mission) -> Changes:
    """The tracker `geometric`, as it comes, or `velocity` where it leaves enough of a margin."""
    for vehicle in mission.own():
        if mission.at("tracker", of=vehicle.node) is None:
            yield change(add(vehicle.node, "tracker: {use: geometric}"))
            if mission.word("like", of=vehicle.node) == "std.nano_plus":
                yield change(add(vehicle.node, "tracker: velocity"))


@valid
def a_looser_bound(mission: Mission) -> Changes:
    """An expectation with 1.5 times its bound."""
    for node in mission.expectations(") < "):
        match = _BOUND.fullmatch(node.value)
        if match and "state" not in match[2]:
            yield change(
                put(node, f"{match[1]}({match[2]}) < {1.5 * float(match[3]):.4g} {match[4]}")
            )


@valid
def an_expectation_more(mission: Mission) -> Changes:
    """That it stays within 30 cm of what it is asked for: three times what was seen, but where what
    is in the way keeps it off."""
    vehicles = mission.plan.vehicles
    kept_off = any(part.cls.goes_round for one in vehicles for part in one.processors)
    for vehicle in () if mission.name == "squad" else mission.own():
        if not kept_off:
            yield change(own_list(mission, "expect", f"max({vehicle.name}.position_error) < 30 cm"))
        yield change(own_list(mission, "expect", f"max({vehicle.name}.state.tilt) < 18 deg"))
        yield change(own_list(mission, "expect", f"max({vehicle.name}.state.altitude) < 2.1 m"))


@valid
def a_later_finish(mission: Mission) -> Changes:
    """Twice the time to finish."""
    for node in mission.expectations("finished"):
        seconds = float(re.findall(r"\d+", node.value)[0])
        yield change(put(node, f"finished within {2 * seconds:g} s"))


@valid
def a_battery_that_lands_earlier(mission: Mission) -> Changes:
    """It warns below 40 % and lands below 25 %."""
    for vehicle in mission.own():
        if mission.at("supervisors", of=vehicle.node) is None and not _library(
            mission, vehicle.node
        ):
            entry = "supervisors: [{use: battery, warn_below: 40 %, land_below: 25 %}]"
            yield change(add(vehicle.node, entry))


@valid
def sensible_supervisors(mission: Mission) -> Changes:
    """Tighter tilt, spin and link, as somebody careful would have them."""
    for vehicle in mission.own():
        if mission.at("supervisors", of=vehicle.node) is None and not _library(
            mission, vehicle.node
        ):
            entries = (
                "{use: tilt, limit: 45 deg}, {use: spin, limit: 180 deg/s}, {use: link, age: 0.3 s}"
            )
            yield change(add(vehicle.node, f"supervisors: [{entries}]"))


@valid
def a_severer_reaction(mission: Mission) -> Changes:
    """It flies home when it leaves the fence, and lands when its estimate jumps."""
    for vehicle in mission.own():
        if mission.at("supervisors", of=vehicle.node) is None and not _library(
            mission, vehicle.node
        ):
            entries = "{use: fence, reaction: go_home}, {use: jump, reaction: land}"
            yield change(add(vehicle.node, f"supervisors: [{entries}]"))


def _library(mission: Mission, vehicle: Node) -> bool:
    return mission.word("like", of=vehicle).startswith("lab.")


@valid
def dead_reckoning_behind_it(mission: Mission) -> Changes:
    """Dead reckoning as the second choice, as the tutorial does."""
    for vehicle in mission.own():
        if mission.at("estimators", of=vehicle.node) is None and not _library(
            mission, vehicle.node
        ):
            first = "{use: mocap, healthy: age < 250 ms, recover_after: 1 s}"
            yield change(
                add(vehicle.node, f"estimators: [{first}, {{use: inertial, for_at_most: 3 s}}]")
            )


@valid
def an_obstacle_in_a_corner(mission: Mission) -> Changes:
    """A crate in a corner of the room where nobody flies."""
    fence, world = mission.plan.fence, mission.at("world")
    if fence is not None and isinstance(world, yaml.MappingNode):
        x, y = fence.high[0] - 0.05, fence.low[1] + 0.05
        shape = f"thing: {{box: {{from: [{x - 0.2:g}, {y:g}, 0], to: [{x:g}, {y + 0.2:g}, 0.4]}}}}"
        own = mission.at("obstacles", of=world)
        yield change(add(own, shape) if own else add(world, f"obstacles: {{{shape}}}"))


@valid
def a_larger_room(mission: Mission) -> Changes:
    """A fence half a metre wider and higher, in which nobody steers against it."""
    corner = mission.at("world", "fence", "to")
    if corner is not None and "do: steer" not in mission.text:
        texts = ", ".join(f"{float(n.value) + 0.5:g}" for n in corner.value)
        yield change(put(corner, f"[{texts}]"))


@valid
def a_start_a_little_aside(mission: Mission) -> Changes:
    """A start 5 cm aside, and turned to the north where nobody follows a heading."""
    turned = "" if "leader: " in mission.text else ", heading: 90 deg"
    for vehicle in mission.own():
        start, at = (mission.at(*k, of=vehicle.node) for k in (("start",), ("start", "at")))
        if start is not None and at is not None and at.id == "sequence":
            x, y, z = mission.planned(vehicle.name).start
            place = f"{{at: [{x + 0.05:g}, {y:g}, {z:g}]{turned}}}"
            yield change(put(start, place))


@valid
def a_way_out_for_a_low_battery(mission: Mission) -> Changes:
    """It lands when half of the battery is gone."""
    for state in mission.flying():
        if mission.at("next", of=state.node) is None and mission.at("flows") is None:
            go = mission.landing(state.vehicle)
            yield change(add(state.node, f"next: [{{when: battery.remaining < 50 %, go: {go}}}]"))


@valid
def a_way_out_for_a_person(mission: Mission) -> Changes:
    """It lands when a person asks for it by an event of their own."""
    for state in mission.flying():
        if mission.at("next", of=state.node) is None and mission.at("flows") is None:
            go = mission.landing(state.vehicle)
            yield change(add(state.node, f"next: [{{event: operator.enough, go: {go}}}]"))


@valid
def a_failed_for_what_may_fail(mission: Mission) -> Changes:
    """What can fail lands where it is, in so many words."""
    for state in mission.flying("fly_to", "follow_path"):
        if mission.at("failed", of=state.node) is None and mission.at("flows") is None:
            yield change(add(state.node, f"failed: {mission.landing(state.vehicle)}"))


@valid
def a_message(mission: Mission) -> Changes:
    """A callback that writes a line when somebody has landed."""
    yield change(own_list(mission, "on", '{event: any.landed, do: [{log: "{vehicle} is down"}]}'))


@valid
def a_gust_more(mission: Mission) -> Changes:
    """A gust of 0.5 m/s, 6 s after the start."""
    if mission.name not in ("fallback", "two_lives", "courier", "courier_hard", "squad"):
        for vehicle in mission.own():
            gust = "inject: gust, velocity: [0.5, 0, 0], for: 1 s"
            yield change(own_list(mission, "faults", f"{{at: 6 s, on: {vehicle.name}, {gust}}}"))


@valid
def a_time_limit(mission: Mission) -> Changes:
    """A run is ended after five minutes, which is longer than it takes."""
    key = next(key for key, _ in mission.root.value if key.value == "vehicles")
    yield change(Edit(key.start_mark.index, key.start_mark.index, "time_limit: 5 min\n\n"))


@valid
def a_faster_loop(mission: Mission) -> Changes:
    """A control rate of 250 Hz in place of 125 Hz."""
    key = next(key for key, _ in mission.root.value if key.value == "vehicles")
    yield change(Edit(key.start_mark.index, key.start_mark.index, "control: 250 Hz\n\n"))


@valid
def a_heavier_battery(mission: Mission) -> Changes:
    """An airframe a twentieth heavier, which flies a minute longer."""
    for vehicle in mission.own():
        like = mission.word("like", of=vehicle.node)
        frame = mission.planned(vehicle.name).airframe
        values = f"mass: {1.05 * frame.mass:g} kg, endurance: {frame.endurance + 60:g} s"
        entry = f"heavier: {{like: {like}, {values}}}"
        yield change(
            own_section(mission, "airframes", entry), add(vehicle.node, "airframe: heavier")
        )


@valid
def gentler_gains(mission: Mission) -> Changes:
    """`cascade` with its gains a tenth lower, on the airframe that it has margin on."""
    gains = "proportional: 8.1, derivative: 6.75, integral: 4"
    for vehicle in mission.own():
        own = mission.at("tracker", of=vehicle.node)
        tracker = f"{{use: cascade, {gains}}}"
        if "nano_plus" in mission.word("like", of=vehicle.node):
            yield change(put(own, tracker) if own else add(vehicle.node, f"tracker: {tracker}"))


@valid
def processors_as_they_come(mission: Mission) -> Changes:
    """The default list, written out, with a larger margin."""
    for vehicle in mission.own():
        if mission.at("processors", of=vehicle.node) is None and not _library(
            mission, vehicle.node
        ):
            entries = "limit_speed, limit_acceleration, {use: fence, margin: 25 cm}, position_error"
            yield change(add(vehicle.node, f"processors: [{entries}]"))


@valid
def still_air(mission: Mission) -> Changes:
    """A target without a lab's disturbances."""
    if mission.at("targets") is None:
        yield change(
            own_section(mission, "targets", "calm: {all: {driver: {use: sim, calm: true}}}")
        )


@valid
def a_little_more_distance(mission: Mission) -> Changes:
    """`avoid_obstacles` keeps 5 cm more."""
    yield from tuned(mission, "keep", "25 cm")


@valid
def the_others_by_name(mission: Mission) -> Changes:
    """`treat_as_obstacles` names every vehicle, as `all others` would."""
    names = ", ".join(v.name for v in mission.plan.vehicles)
    if len(mission.plan.vehicles) > 1:
        yield from tuned(mission, "treat_as_obstacles", f"[{names}]")


@valid
def avoids_where_it_need_not(mission: Mission) -> Changes:
    """The default list with `avoid_obstacles` in it, where nobody comes near."""
    for vehicle in mission.own():
        if mission.at("processors", of=vehicle.node) is None and not _library(
            mission, vehicle.node
        ):
            entries = f"limit_speed, limit_acceleration, {AVOID}, fence, position_error"
            yield change(add(vehicle.node, f"processors: [{entries}]"))


@valid
def a_ball_high_in_a_corner(mission: Mission) -> Changes:
    """A small ball goes to and fro in an upper corner of the room where nobody flies."""
    fence = mission.plan.fence
    if fence is not None and "do: steer" not in mission.text and fence.high[2] > 2.3:
        x, y, z = fence.high[0], fence.low[1], fence.high[2]
        along = f"[[{x + 0.5:g}, {y - 0.5:g}, {z:g}], [{x + 0.8:g}, {y - 0.5:g}, {z:g}]]"
        yield from with_ball(mission, along, "20 cm/s")


@valid
def a_thing_to_be_touched(mission: Mission) -> Changes:
    """A bar in a corner that may be touched."""
    fence, world = mission.plan.fence, mission.at("world")
    if fence is not None and isinstance(world, yaml.MappingNode):
        x, y = fence.high[0] - 0.05, fence.low[1] + 0.05
        box = f"box: {{from: [{x - 0.2:g}, {y:g}, 0], to: [{x:g}, {y + 0.2:g}, 0.4]}}"
        shape, own = f"bar: {{{box}, contact: allowed}}", mission.at("obstacles", of=world)
        yield change(add(own, shape) if own else add(world, f"obstacles: {{{shape}}}"))


@valid
def a_formation_of_a_little_slower_news(mission: Mission) -> Changes:
    """News arrive after 40 ms."""
    yield from told(mission, "delay", "40 ms", "formation", "follow")


@valid
def news_that_may_be_older(mission: Mission) -> Changes:
    """News count as new for half a second."""
    yield from told(mission, "freshness", "500 ms", "formation", "follow")


@valid
def a_wider_formation(mission: Mission) -> Changes:
    """Places a twentieth further from each other."""
    yield from _scaled(mission, "side", 1.05, "formation")


@valid
def to_the_corners_in_turns(mission: Mission) -> Changes:
    """Those who fly to places of their own arrive in turns or together."""
    if mission.name == "formation":
        yield from arriving(mission, "in_turns", "fly_to")
        yield from arriving(mission, "together", "fly_to")


@valid
def a_drone_that_blinks(mission: Mission) -> Changes:
    """An AR.Drone blinks when it has taken off."""
    if "std.ardrone" in mission.text:
        yield from acts(mission, "", "leds_blink_green", target="emulated_ardrone")
