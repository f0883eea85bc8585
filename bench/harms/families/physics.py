"""Values against physics: conditions that the room and the airframe decide before the flight, and
motion that no quadrotor follows."""

from __future__ import annotations

from harms.mission_text import Edit, Mission, State, add, append, put
from harms.operator import Changes, change, dangerous, senseless


def way_out(mission: Mission, state: State, cause: str) -> Edit:
    """The state has one more way out, to the landing, asked before the others."""
    item = f"{{{cause}, go: {mission.landing(state.vehicle)}}}"
    ways = mission.at("next", of=state.node)
    if ways is None:
        return add(state.node, f"next: [{item}]")
    return append(ways, item) if not ways.flow_style else _front(ways.start_mark.index, item)


def _front(start: int, item: str) -> Edit:
    return Edit(start + 1, start + 1, f"{item}, ")


def _never(mission: Mission, cause: str) -> Changes:
    for state in mission.flying():
        yield change(way_out(mission, state, cause))


@senseless
def altitude_beyond_the_fence(mission: Mission) -> Changes:
    """`state.altitude > 40 m` under a ceiling of 2.5 m: never true."""
    yield from _never(mission, "when: state.altitude > 40 m")


@senseless
def speed_beyond_the_airframe(mission: Mission) -> Changes:
    """`state.speed > 30 m/s`, km/h in mind, on an airframe that flies 1 m/s: never true."""
    yield from _never(mission, "when: state.speed > 30 m/s")


@senseless
def tilt_beyond_upside_down(mission: Mission) -> Changes:
    """`state.tilt > 200 deg`: a tilt ends at 180 deg, so it is never true."""
    yield from _never(mission, "when: state.tilt > 200 deg")


@senseless
def place_beyond_the_fence(mission: Mission) -> Changes:
    """`state.x > 25 m` in a room of 6 m: never true."""
    yield from _never(mission, "when: state.x > 25 m")


@senseless
def near_a_place_outside(mission: Mission) -> Changes:
    """Near a place 50 m up, over a ceiling of 2.5 m: never true."""
    for state in mission.flying():
        cause = f"when: 'distance({state.vehicle} to [0 0 50]) < 1 m'"
        yield change(way_out(mission, state, cause))


@senseless
def battery_below_nothing(mission: Mission) -> Changes:
    """`battery.remaining < 0 %`: never true; `20 %` without its first digit."""
    yield from _never(mission, "when: battery.remaining < 0 %")


@senseless
def battery_above_full(mission: Mission) -> Changes:
    """`battery.remaining > 100 %`: no battery has more than all, so it is never true."""
    yield from _never(mission, "when: battery.remaining > 100 %")


@senseless
def age_below_nothing(mission: Mission) -> Changes:
    """`estimate.age < 0 s`: a measurement isn't younger than now."""
    yield from _never(mission, "when: estimate.age < 0 s")


@senseless
def true_at_once_below(mission: Mission) -> Changes:
    """`state.altitude < 100 m`: true wherever it may fly, so that the state is left at once."""
    yield from _never(mission, "when: state.altitude < 100 m")


@senseless
def true_at_once_battery(mission: Mission) -> Changes:
    """`battery.remaining < 101 %`: always true, so that the state is left at once."""
    yield from _never(mission, "when: battery.remaining < 101 %")


@senseless
def true_at_once_elapsed(mission: Mission) -> Changes:
    """`elapsed >= 0 s`: always true, so that the state is left at once."""
    yield from _never(mission, "when: elapsed >= 0 s")


@senseless
def contradiction(mission: Mission) -> Changes:
    """`state.altitude > 2 m and state.altitude < 1 m`: never true; `or` was meant."""
    yield from _never(mission, "when: state.altitude > 2 m and state.altitude < 1 m")


@senseless
def true_of_everything(mission: Mission) -> Changes:
    """`state.x > 1 m or state.x < 2 m`: always true; `and` was meant."""
    yield from _never(mission, "when: state.x > 1 m or state.x < 2 m")


@dangerous
def straight_and_too_fast(mission: Mission) -> Changes:
    """`fly_to` and `follow_path` with 20 m/s on an airframe for 1 m/s."""
    for state in mission.states("fly_to", "follow_path"):
        speed = mission.at("speed", of=state.node)
        yield change(put(speed, "20 m/s") if speed else add(state.node, "speed: 20 m/s"))


@dangerous
def circle_too_fast(mission: Mission) -> Changes:
    """A circle with 5 m/s on an airframe for 1 m/s: it tilts far more than it may."""
    for state in mission.states("circle"):
        speed = mission.at("speed", of=state.node)
        yield change(put(speed, "5 m/s") if speed else add(state.node, "speed: 5 m/s"))


@senseless
def acceleration_beyond_tilt(mission: Mission) -> Changes:
    """`acceleration: 50 m/s^2`: five times gravity, sideways; the processors make 3 m/s^2 of
    it."""
    for state in mission.states("fly_to", "follow_path"):
        yield change(add(state.node, "acceleration: 50 m/s^2"))


@dangerous
def lap_too_short(mission: Mission) -> Changes:
    """An eight in 1 s: sharper than anything tilts."""
    for state in mission.states("figure_eight"):
        lap = mission.at("lap", of=state.node)
        if lap is not None:
            yield change(put(lap, "1 s"))


@dangerous
def climb_too_fast(mission: Mission) -> Changes:
    """A take-off with 15 m/s, in a room of 2.5 m."""
    for state in mission.states("take_off"):
        yield change(add(state.node, "speed: 15 m/s, acceleration: 40 m/s^2"))


@dangerous
def landing_too_fast(mission: Mission) -> Changes:
    """A landing with 3 m/s: it breaks its legs."""
    for state in mission.states("land"):
        yield change(add(state.node, "speed: 3 m/s"))


@dangerous
def steered_too_fast(mission: Mission) -> Changes:
    """A hand that steers with up to 15 m/s in a room of 6 m."""
    for state in mission.states("steer"):
        speed = mission.at("speed", of=state.node)
        if speed is not None:
            yield change(put(speed, "15 m/s"))


@senseless
def tolerance_of_a_room(mission: Mission) -> Changes:
    """`tolerance: 8 m`: it counts as there wherever it is, so that nothing is ever reached."""
    for state in mission.states("fly_to", "follow_path", "take_off"):
        yield change(add(state.node, "tolerance: 8 m"))


@senseless
def tolerance_of_a_hair(mission: Mission) -> Changes:
    """`tolerance: 0.01 mm`, twenty times less than motion capture's noise: it never counts as
    there, and fails."""
    for state in mission.states("fly_to", "follow_path"):
        yield change(add(state.node, "tolerance: 0.01 mm"))


@senseless
def clearance_of_a_room(mission: Mission) -> Changes:
    """A clearance of 5 m from obstacles in a room of 6 m: there is nowhere to steer to."""
    for state in mission.states("steer"):
        clearance = mission.at("clearance", of=state.node)
        if clearance is not None:
            yield change(put(clearance, "5 m"))
