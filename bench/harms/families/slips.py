"""Slips of the keyboard: a comma for a point, a colon left out, the wrong unit or a digit."""

from __future__ import annotations

import yaml

from harms.mission_text import Mission, Node, Quantity, add, put
from harms.operator import Changes, change, dangerous, senseless

METRES = ("height", "radius", "width", "clearance")


def _params(mission: Mission, *names: str) -> list[tuple[Node, Node, Quantity]]:
    """Mapping, value and quantity of the parameters of states that are written in their place."""
    found = []
    for state in mission.states():
        for key, value in mission.pairs(of=state.node):
            quantity = mission.written(value)
            if key.value in names and quantity is not None:
                found.append((state.node, value, quantity))
    return found


def _points(mission: Mission) -> list[Node]:
    """Points that are written as three numbers in states."""
    found = []
    for state in mission.states("fly_to", "circle", "follow_path", "land"):
        for key, value in mission.pairs(of=state.node):
            if key.value in ("position", "center") and value.value and value.id == "sequence":
                found.append(value)
            if key.value == "path":
                found += [point for point in value.value if point.id == "sequence"]
    return found


def _coordinates(mission: Mission, point: Node) -> list[float]:
    values = [mission.quantity(node) for node in point.value]
    return [q.number for q in values if q is not None]


@senseless
def decimal_comma(mission: Mission) -> Changes:
    """`1,5 m` for `1.5 m`, as half of the world writes: YAML reads `1` and an odd key, and the
    vehicle flies at another height, width or speed than it says."""
    for holder, value, q in _params(mission, *METRES, "speed"):
        if holder.flow_style:
            number = q.number if q.number % 1 else q.number + 0.5
            yield change(put(value, f"{number:g} {q.unit}".replace(".", ",")))


@dangerous
def decimal_comma_in_a_point(mission: Mission) -> Changes:
    """`[0,6, 0, 1]`: the comma makes four numbers, and every one of them stands elsewhere."""
    for point in _points(mission):
        first = mission.written(point.value[0])
        if first is not None:
            number = first.number if first.number % 1 else first.number + 0.5
            yield change(put(point.value[0], f"{number:g}".replace(".", ",")))


@senseless
def forgotten_colon_within(mission: Mission) -> Changes:
    """`within 15 s`: the limit that it writes is none."""
    yield from _without_colon(mission, "within")


@dangerous
def forgotten_colon_then(mission: Mission) -> Changes:
    """`then down`: nothing follows, so the vehicle hovers until a limit lands it."""
    yield from _without_colon(mission, "then")


@senseless
def forgotten_colon_speed(mission: Mission) -> Changes:
    """`speed 0.5 m/s`: it flies with the default speed, not with what it says."""
    yield from _without_colon(mission, "speed")


@senseless
def forgotten_colon_for_time(mission: Mission) -> Changes:
    """`for_time 3 s`: it hovers without an end, what follows is never flown."""
    yield from _without_colon(mission, "for_time")


def _without_colon(mission: Mission, name: str) -> Changes:
    for state in mission.states():
        for key, value in mission.pairs(of=state.node):
            if key.value == name and state.node.flow_style and value.id == "scalar":
                edit = put(key, f"{name} {value.value}")
                yield change(edit._replace(end=value.end_mark.index))


@senseless
def centimetres_for_metres(mission: Mission) -> Changes:
    """`height: 1 cm` for `1 m`: it has taken off before it has left the ground."""
    for _, value, q in _params(mission, "height"):
        if q.unit == "m":
            yield change(put(value, f"{q.number:g} cm"))


@dangerous
def metres_for_centimetres(mission: Mission) -> Changes:
    """`radius: 60 m` for `60 cm`: the way leaves the room."""
    for _, value, q in _params(mission, "radius", "width"):
        metres = q.number if q.unit == "cm" else 100 * q.number
        yield change(put(value, f"{metres:g} m"))


@dangerous
def unit_forgotten(mission: Mission) -> Changes:
    """`radius: 60`, meant in cm: a bare number is metres, and the way leaves the room."""
    for _, value, q in _params(mission, "radius", "width"):
        number = q.number if q.unit == "cm" else 100 * q.number
        yield change(put(value, f"{number:g}"))


@dangerous
def metres_a_second_for_centimetres(mission: Mission) -> Changes:
    """`speed: 60 m/s` for `60 cm/s`: a hundred times faster than the airframe can."""
    for _, value, q in _params(mission, "speed"):
        number = q.number if q.unit == "cm/s" else 100 * q.number
        yield change(put(value, f"{number:g} m/s"))


@senseless
def milliseconds_for_seconds(mission: Mission) -> Changes:
    """`within: 15 ms`: over before anything has moved, so the behavior never ends as it should."""
    for _, value, q in _params(mission, "within"):
        if q.unit == "s":
            yield change(put(value, f"{q.number:g} ms"))


@dangerous
def seconds_for_milliseconds(mission: Mission) -> Changes:
    """`silent_after: 300 s`: a lost controller steers for minutes with what it said last."""
    for key, node in mission.pairs("inputs"):
        value = mission.at("silent_after", of=node)
        if value is not None and key.value:
            yield change(put(value, value.value.replace("ms", "s")))


@senseless
def healthy_in_seconds(mission: Mission) -> Changes:
    """`age < 250 s` for `250 ms`: no measurement is ever too old, and no other estimator helps."""
    for vehicle in mission.vehicles():
        for entry in mission.items("estimators", of=vehicle.node):
            healthy = mission.at("healthy", of=entry)
            if healthy is not None and " ms" in healthy.value:
                yield change(put(healthy, healthy.value.replace(" ms", " s")))


@senseless
def minutes_for_seconds(mission: Mission) -> Changes:
    """`for_time: 3 min` for `3 s`: the mission can't be finished in the time that it expects."""
    finished = mission.expectations("finished")
    for _, value, q in _params(mission, "for_time"):
        if q.unit == "s" and finished:
            yield change(put(value, f"{q.number:g} min"), also=tuple(finished))


@dangerous
def radians_for_degrees(mission: Mission) -> Changes:
    """`tilt: 20 rad`: three turns and more, where 20 deg were meant."""
    for vehicle in mission.own():
        tracker = mission.at("tracker", of=vehicle.node)
        if tracker is None:
            yield change(add(vehicle.node, "tracker: {use: cascade, tilt: 20 rad}"))


@senseless
def heading_in_radians(mission: Mission) -> Changes:
    """`heading: 90 rad` for `90 deg`: fourteen turns and some rest, which nobody means."""
    for vehicle in mission.own():
        start = mission.at("start", of=vehicle.node)
        if isinstance(start, yaml.MappingNode):
            yield change(add(start, "heading: 90 rad"))


@senseless
def turn_rate_in_radians(mission: Mission) -> Changes:
    """`turn_rate: 45 rad/s` for `45 deg/s`: seven turns a second, which no airframe follows."""
    for state in mission.states("fly_to", "follow_path", "steer"):
        turn = (
            "turn_rate: 45 rad/s" if state.do == "steer" else "heading: 90 deg, turn_rate: 45 rad/s"
        )
        if state.node.flow_style:
            yield change(add(state.node, turn))


@senseless
def heading_without_unit(mission: Mission) -> Changes:
    """`heading: 90`: degrees or radians? People mean both."""
    for state in mission.states("fly_to", "follow_path"):
        if state.node.flow_style:
            yield change(add(state.node, "heading: 90"))


@dangerous
def decimal_point_lost(mission: Mission) -> Changes:
    """`12 m` for `1.2 m`: through the ceiling, or out of the room."""
    for holder, value, q in _params(mission, "height", "radius", "width"):
        if q.unit == "m" and mission.word("do", of=holder) != "go_home":
            yield change(put(value, f"{10 * q.number:g} m"))
    for point in _points(mission):
        last = mission.written(point.value[2])
        if last is not None and last.number > 0:
            yield change(put(point.value[2], f"{10 * last.number:g}"))


@dangerous
def digit_twice(mission: Mission) -> Changes:
    """`11 m` for `1 m`: a key that was pressed twice."""
    for holder, value, q in _params(mission, "height"):
        if q.unit == "m" and mission.word("do", of=holder) != "go_home":
            yield change(put(value, f"{str(int(q.number)) * 2} m"))


@senseless
def speed_a_hundredth(mission: Mission) -> Changes:
    """`0.005 m/s` for `0.5 m/s`: it takes minutes for what it has seconds for."""
    for holder, value, q in _params(mission, "speed"):
        limit = mission.at("within", of=holder)
        others = (limit, *mission.expectations("finished"))
        if q.unit == "m/s" and mission.word("do", of=holder) != "steer" and any(others):
            yield change(put(value, f"{q.number / 100:g} m/s"), also=others)


@dangerous
def height_below_the_ground(mission: Mission) -> Changes:
    """A sign: `[1, 0, -1]` leads into the floor."""
    for point in _points(mission):
        last = mission.written(point.value[2])
        if last is not None and last.number > 0:
            yield change(put(point.value[2], f"-{last.number:g}"))


@dangerous
def coordinates_swapped(mission: Mission) -> Changes:
    """`[x, z, y]` for `[x, y, z]`: what was meant as y is a height below the ground."""
    for point in _points(mission):
        numbers = _coordinates(mission, point)
        if len(numbers) == 3 and numbers[1] < 0 < numbers[2]:
            texts = [mission.text[n.start_mark.index : n.end_mark.index] for n in point.value]
            yield change(put(point, f"[{texts[0]}, {texts[2]}, {texts[1]}]"))


@dangerous
def coordinate_missing(mission: Mission) -> Changes:
    """`[1, 1]`: two numbers are no place."""
    for point in _points(mission):
        texts = [mission.text[n.start_mark.index : n.end_mark.index] for n in point.value]
        yield change(put(point, f"[{texts[0]}, {texts[1]}]"))


@dangerous
def values_of_two_keys_swapped(mission: Mission) -> Changes:
    """`lap: 2 s, laps: 10` for `lap: 10 s, laps: 2`: five times as fast, sharper than it tilts."""
    for state in mission.states("figure_eight"):
        lap, laps = (mission.at(k, of=state.node) for k in ("lap", "laps"))
        if lap is not None and laps is not None:
            yield change(put(lap, "2 s"), put(laps, "10"))


@dangerous
def radius_and_speed_swapped(mission: Mission) -> Changes:
    """`radius: 5 cm, speed: 0.8 m/s`-like: numbers of two keys swapped, so that the circle is far
    too sharp for what it tilts."""
    for state in mission.states("circle"):
        radius, speed = (mission.at(k, of=state.node) for k in ("radius", "speed"))
        if radius is not None and speed is not None and mission.written(radius):
            yield change(put(radius, "4 cm"), put(speed, "0.9 m/s"))


@dangerous
def fence_corners_swapped(mission: Mission) -> Changes:
    """`from` and `to` of the fence exchanged: a box that nothing is in."""
    low, high = mission.at("world", "fence", "from"), mission.at("world", "fence", "to")
    if low is not None and high is not None:
        texts = [mission.text[n.start_mark.index : n.end_mark.index] for n in (low, high)]
        yield change(put(low, texts[1]), put(high, texts[0]))
