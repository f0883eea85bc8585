"""Times that are too short for the deed, and such that the battery doesn't last for."""

from __future__ import annotations

from harms.mission_text import Edit, Mission, Node, add, put
from harms.operator import Changes, change, dangerous, senseless

MOVING = ("fly_to", "follow_path", "circle", "figure_eight", "follow_trajectory")


def _within(mission: Mission, time: str, *parts: str) -> Changes:
    for state in mission.states(*parts):
        limit = mission.at("within", of=state.node)
        edit = put(limit, time) if limit is not None else add(state.node, f"within: {time}")
        yield change(edit)


def _top(mission: Mission, entry: str) -> Edit:
    """The mission has one more key, before its vehicles, in place of one that it has."""
    name = entry.partition(":")[0]
    own = mission.at(name)
    if own is not None:
        return put(own, entry.partition(": ")[2])
    key = next(key for key, _ in mission.root.value if key.value == "vehicles")
    return Edit(key.start_mark.index, key.start_mark.index, f"{entry}\n\n")


@senseless
def take_off_in_half_a_second(mission: Mission) -> Changes:
    """`within: 500 ms` for a climb of a metre at 0.3 m/s: it never gets there."""
    yield from _within(mission, "500 ms", "take_off")


@senseless
def flown_in_no_time(mission: Mission) -> Changes:
    """`within: 800 ms` for a way of metres: it never gets there."""
    yield from _within(mission, "800 ms", *MOVING)


@senseless
def hover_longer_than_its_limit(mission: Mission) -> Changes:
    """`for_time: 3 s, within: 1 s`: the hover never ends as it should."""
    for state in mission.states("hover"):
        time = mission.at("for_time", of=state.node)
        if time is not None:
            yield change(add(state.node, "within: 1 s"), also=(time,))


@dangerous
def laps_a_hundred_times(mission: Mission) -> Changes:
    """`laps: 400` where 4 were meant: the battery ends in the air."""
    for state in mission.states("circle", "figure_eight"):
        laps = mission.at("laps", of=state.node)
        if laps is not None:
            yield change(put(laps, "400"))


@dangerous
def hover_beyond_the_battery(mission: Mission) -> Changes:
    """`for_time: 40 min` on an airframe that flies 10: the battery ends in the air."""
    for state in mission.states("hover"):
        time = mission.at("for_time", of=state.node)
        if time is not None:
            yield change(put(time, "40 min"))


@senseless
def battery_empty_at_the_start(mission: Mission) -> Changes:
    """The simulated battery begins with 1 %, where a vehicle lands below 15 %: nothing is flown."""
    if mission.at("targets") is None:
        yield change(_top(mission, "targets: {sim: {all: {driver: {use: sim, battery: 1 %}}}}"))


@senseless
def run_over_too_soon(mission: Mission) -> Changes:
    """`time_limit: 3 s`: the run lands everybody before the first has climbed."""
    yield change(_top(mission, "time_limit: 3 s"))


@senseless
def limit_within_the_mission(mission: Mission) -> Changes:
    """`time_limit` of half of what the hovers and laps take alone."""
    total = max(_least(mission, vehicle.name) for vehicle in mission.plan.vehicles)
    if total > 10.0 and mission.at("flows") is None:
        yield change(_top(mission, f"time_limit: {total / 2:.0f} s"))


def _least(mission: Mission, vehicle: str) -> float:
    """Seconds that a vehicle takes at least: its hovers, laps and circles, on its way by `then`."""
    plan, total = mission.planned(vehicle), 0.0
    name = plan.begin
    for _ in plan.states:
        state = plan.states[name]
        params = state.behavior.params
        total += getattr(params, "for_time", None) or 0.0
        if state.behavior.name == "figure_eight":
            total += params.lap * params.laps
        if state.behavior.name == "circle" and params.laps:
            total += 6.28 * params.radius * params.laps / abs(params.speed)
        name = next((t.target for t in state.transitions if t.cause == "then"), "")
        if name not in plan.states:
            break
    return total


@senseless
def dwell_beyond_patience(mission: Mission) -> Changes:
    """`dwell: 60 s` with a patience of 10 s: it fails before it may be done."""
    for state in mission.states("fly_to", "follow_path"):
        yield change(add(state.node, "dwell: 60 s"))


@senseless
def patience_of_a_moment(mission: Mission) -> Changes:
    """`patience: 1 ms` with a dwell of 0.3 s: it fails before it may be done."""
    for state in mission.states("fly_to", "take_off"):
        if mission.at("patience", of=state.node) is None:
            yield change(add(state.node, "patience: 1 ms"))


@dangerous
def waits_an_hour_in_the_air(mission: Mission) -> Changes:
    """`after: 60 min` for `60 s`: it hovers until the battery ends, when nobody comes."""
    for state in mission.states("hover"):
        for way in mission.items("next", of=state.node):
            after = mission.at("after", of=way)
            if after is not None:
                yield change(put(after, "60 min"))


@senseless
def phase_too_short(mission: Mission) -> Changes:
    """A phase has 500 ms for a take-off or a way of metres: it always goes to `otherwise`."""
    for node in _phases(mission):
        limit = mission.at("within", of=node)
        if limit is not None:
            yield change(put(limit, "500 ms"))


def _phases(mission: Mission) -> list[Node]:
    flows = [flow for _, flow in mission.pairs("flows")]
    return [phase for flow in flows for _, phase in mission.pairs("phases", of=flow)]


@senseless
def condition_held_too_long(mission: Mission) -> Changes:
    """`for: 10 min` in a state that lasts seconds: the way out is never taken."""
    for state in mission.flying("hover", "circle", "follow_path", "figure_eight"):
        ends = mission.at("for_time", of=state.node) or mission.at("laps", of=state.node)
        if mission.at("next", of=state.node) is None and ends is not None:
            go = mission.landing(state.vehicle)
            way = f"next: [{{when: battery.remaining < 50 %, for: 10 min, go: {go}}}]"
            yield change(add(state.node, way), also=(ends,))


@senseless
def elapsed_beyond_the_state(mission: Mission) -> Changes:
    """`elapsed > 5 min` in a hover of 3 s: never true."""
    for state in mission.flying("hover"):
        ends = mission.at("for_time", of=state.node)
        if mission.at("next", of=state.node) is None and ends is not None:
            go = mission.landing(state.vehicle)
            way = f"next: [{{when: elapsed > 5 min, go: {go}}}]"
            yield change(add(state.node, way), also=(ends,))


@senseless
def after_beyond_the_state(mission: Mission) -> Changes:
    """`after: 5 min` in a hover of 3 s: never taken."""
    for state in mission.flying("hover"):
        ends = mission.at("for_time", of=state.node)
        if mission.at("next", of=state.node) is None and ends is not None:
            way = f"next: [{{after: 5 min, go: {mission.landing(state.vehicle)}}}]"
            yield change(add(state.node, way), also=(ends,))
