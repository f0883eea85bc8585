"""Expectations that can't fail, which test nothing, and such that can't hold."""

from __future__ import annotations

import re

from harms.mission_text import Mission, Node, own_list, put
from harms.operator import Changes, change, senseless

_ERROR = re.compile(r"(.*position_error.*) < .*")


def _errors(mission: Mission, bound: str) -> Changes:
    for node in mission.expectations("position_error"):
        match = _ERROR.fullmatch(node.value)
        if match:
            yield change(put(node, f"{match[1]} < {bound}"))


def _about(mission: Mission, text: str, also: tuple[Node, ...] = ()) -> Changes:
    for vehicle in mission.own():
        yield change(own_list(mission, "expect", text.replace("V", vehicle.name)), also=also)


@senseless
def error_of_a_kilometre(mission: Mission) -> Changes:
    """`position_error < 1000 m`: can't fail, every supervisor would act long before."""
    yield from _errors(mission, "1000 m")


@senseless
def error_in_metres(mission: Mission) -> Changes:
    """`< 10` where 10 cm are meant: 10 m in a room of 6 m can't fail."""
    yield from _errors(mission, "10")


@senseless
def error_below_nothing(mission: Mission) -> Changes:
    """`position_error < 0 cm`: a distance isn't below zero, so it can't hold."""
    yield from _errors(mission, "0 cm")


@senseless
def error_turned_round(mission: Mission) -> Changes:
    """`> 0 cm` for `< 10 cm`: true of every flight."""
    for node in mission.expectations("position_error"):
        match = _ERROR.fullmatch(node.value)
        if match:
            yield change(put(node, f"{match[1]} >= 0 cm"))


@senseless
def never_on_the_ground(mission: Mission) -> Changes:
    """`min(altitude) > 1 m` over a run that begins on the ground: can't hold."""
    yield from _about(mission, "min(V.state.altitude) > 1 m")


@senseless
def always_in_the_air(mission: Mission) -> Changes:
    """`always state.altitude > 50 cm`: it starts on the ground, so it can't hold."""
    yield from _about(mission, "always V.state.altitude > 50 cm")


@senseless
def higher_than_the_fence(mission: Mission) -> Changes:
    """That it comes up to 10 m, under a fence of 2.5 m: can't hold."""
    yield from _about(mission, "eventually V.state.altitude > 10 m within 20 s")


@senseless
def lower_than_the_sky(mission: Mission) -> Changes:
    """`max(altitude) < 100 m` under a fence of 2.5 m: can't fail."""
    yield from _about(mission, "max(V.state.altitude) < 100 m")


@senseless
def slower_than_a_car(mission: Mission) -> Changes:
    """`max(speed) < 50 m/s` of an airframe for 1 m/s: can't fail."""
    yield from _about(mission, "max(V.state.speed) < 50 m/s")


@senseless
def slower_than_rest(mission: Mission) -> Changes:
    """`max(speed) < -1 m/s`: a speed isn't negative, so it can't hold."""
    yield from _about(mission, "max(V.state.speed) < -1 m/s")


@senseless
def tilted_less_than_upside_down(mission: Mission) -> Changes:
    """`max(tilt) < 180 deg`, where 18 deg were meant: can't fail."""
    yield from _about(mission, "max(V.state.tilt) < 181 deg")


@senseless
def near_enough_anywhere(mission: Mission) -> Changes:
    """That it ends within 100 m of its start, in a room of 6 m: can't fail."""
    yield from _about(mission, "finally distance(V to V.start) < 100 m")


@senseless
def far_beyond_the_walls(mission: Mission) -> Changes:
    """That it ends 30 m from its start, in a room of 6 m: can't hold."""
    yield from _about(mission, "finally distance(V to V.start) > 30 m")


@senseless
def battery_fuller_than_full(mission: Mission) -> Changes:
    """That the battery keeps more than 100 %: can't hold."""
    yield from _about(mission, "always V.battery.remaining > 100 %")


@senseless
def finished_before_it_can_be(mission: Mission) -> Changes:
    """`finished within 2 s`: a take-off alone takes longer."""
    for node in mission.expectations("finished"):
        yield change(put(node, "finished within 2 s"))


@senseless
def finished_after_the_limit(mission: Mission) -> Changes:
    """`finished within 60 min`: every run is ended after ten, so it can't fail."""
    for node in mission.expectations("finished"):
        yield change(put(node, "finished within 60 min"))


@senseless
def ends_in_the_air(mission: Mission) -> Changes:
    """`finally V in hold`: hold is flown, and a run ends with everybody on the ground."""
    for state in mission.states("hover", "fly_to", "circle", "follow_path", "figure_eight"):
        yield change(own_list(mission, "expect", f"finally {state.vehicle} in {state.name}"))


@senseless
def eventually_too_soon(mission: Mission) -> Changes:
    """That it is in the last state within 1 s: a take-off alone takes longer."""
    for state in mission.states("land"):
        text = f"eventually {state.vehicle} in {state.name} within 1 s"
        if mission.planned(state.vehicle).states[state.name].legs and state.name != "here":
            yield change(own_list(mission, "expect", text))


@senseless
def apart_by_more_than_the_room(mission: Mission) -> Changes:
    """`separation > 30 m` in a room of 6 m: can't hold."""
    names = [v.name for v in mission.plan.vehicles]
    if len(names) > 1:
        text = f"always separation({names[0]} and {names[1]}) > 30 m"
        yield change(own_list(mission, "expect", text))


@senseless
def apart_by_nothing(mission: Mission) -> Changes:
    """`separation >= 0 m`: true even when they touch."""
    names = [v.name for v in mission.plan.vehicles]
    if len(names) > 1:
        text = f"always separation({names[0]} and {names[1]}) >= 0 m"
        yield change(own_list(mission, "expect", text))


@senseless
def goal_of_the_other(mission: Mission) -> Changes:
    """`distance(nano to $mk_goal)`: copied from the other vehicle, whose goal is 2 m away."""
    for node in mission.expectations("distance(nano to $nano_goal)"):
        yield change(put(node, node.value.replace("$nano_goal", "$mk_goal")))
