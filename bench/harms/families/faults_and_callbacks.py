"""Faults that never come or nothing survives, callbacks that do nothing or fight the mission."""

from __future__ import annotations

from harms.mission_text import Mission, own_list, put
from harms.operator import Changes, change, dangerous, senseless


def _fault(mission: Mission, text: str) -> Changes:
    for vehicle in mission.own():
        yield change(own_list(mission, "faults", "{" + text.replace("V", vehicle.name) + "}"))


@senseless
def fault_after_the_end(mission: Mission) -> Changes:
    """A fault at 30 min, when every run has long been over: it tests nothing."""
    yield from _fault(mission, "at: 30 min, on: V, inject: gust, velocity: [1, 0, 0], for: 1 s")


@senseless
def fault_above_the_ceiling(mission: Mission) -> Changes:
    """A fault once it is over 50 m, under a ceiling of 2.5 m: never injected."""
    yield from _fault(
        mission, "when: state.altitude > 50 m, on: V, inject: gust, velocity: [1, 0, 0], for: 1 s"
    )


@senseless
def fault_of_no_size(mission: Mission) -> Changes:
    """A gust of [0, 0, 0]: no gust."""
    yield from _fault(mission, "at: 6 s, on: V, inject: gust, velocity: [0, 0, 0], for: 1 s")


@senseless
def battery_that_loses_nothing(mission: Mission) -> Changes:
    """The battery sags by 0 %: it doesn't."""
    yield from _fault(mission, "at: 6 s, on: V, inject: battery_sag, by: 0 %")


@senseless
def dark_camera_that_is_not_there(mission: Mission) -> Changes:
    """The camera goes dark on a vehicle that has none."""
    if not any(v.cameras for v in mission.plan.vehicles):
        yield from _fault(mission, "at: 6 s, on: V, inject: camera_dark, for: 1 s")


@senseless
def lost_motion_capture_that_nobody_needs(mission: Mission) -> Changes:
    """Motion capture is lost for a vehicle that flies on tags."""
    if any(v.cameras for v in mission.plan.vehicles):
        yield from _fault(mission, "at: 6 s, on: V, inject: mocap_dropout, for: 1 s")


@senseless
def fault_in_a_state_that_is_not_there(mission: Mission) -> Changes:
    """A fault in the state `cruise`, from another mission."""
    yield from _fault(mission, "when: V in cruise, on: V, inject: mocap_dropout, for: 1 s")


@dangerous
def hurricane(mission: Mission) -> Changes:
    """A gust of 60 m/s, 60 cm/s in mind: nothing flies in that."""
    yield from _fault(mission, "at: 6 s, on: V, inject: gust, velocity: [60, 0, 0], for: 3 s")


@dangerous
def picked_up_more_than_it_lifts(mission: Mission) -> Changes:
    """It picks up 20 kg, 20 g in mind: it falls."""
    yield from _fault(mission, "at: 6 s, on: V, inject: mass_change, added: 20 kg")


def _callback(mission: Mission, text: str) -> Changes:
    for vehicle in mission.own():
        down, air = mission.landing(vehicle.name), _in_the_air(mission, vehicle.name)
        if down and air and mission.at("flows") is None:
            own = text.replace("DOWN", down).replace("AIR", air).replace("V", vehicle.name)
            yield change(own_list(mission, "on", "{" + own + "}"))


def _in_the_air(mission: Mission, vehicle: str) -> str:
    """A state of a vehicle in which it stays in the air for a while."""
    found = mission.flying("hover", "circle", "figure_eight", "follow_path")
    return next((s.name for s in found if s.vehicle == vehicle), "")


@senseless
def callback_that_does_nothing(mission: Mission) -> Changes:
    """An empty list of actions."""
    yield from _callback(mission, "event: V.landed, do: []")


@senseless
def callback_for_an_event_that_nobody_tells(mission: Mission) -> Changes:
    """`V.arrived`: no part tells it."""
    yield from _callback(mission, 'event: V.arrived, do: [{log: "there"}]')


@senseless
def callback_that_is_never_true(mission: Mission) -> Changes:
    """When the battery has less than nothing: never done."""
    yield from _callback(
        mission, 'event: V.behavior_started, when: V.battery.remaining < 0 %, do: [{log: "low"}]'
    )


@senseless
def callback_for_a_state_that_is_not_there(mission: Mission) -> Changes:
    """`behavior: cruise`, from another mission: never done."""
    yield from _callback(
        mission, 'event: V.behavior_started, behavior: cruise, do: [{log: "on the way"}]'
    )


@senseless
def event_that_nobody_hears(mission: Mission) -> Changes:
    """It emits an event which nothing waits for."""
    yield from _callback(mission, "event: V.took_off, do: [{emit: all_up}]")


@dangerous
def callback_that_calls_itself(mission: Mission) -> Changes:
    """It emits the event that it hears, for ever."""
    yield from _callback(mission, "event: again, do: [{emit: again}]")


@senseless
def callback_against_the_landing(mission: Mission) -> Changes:
    """As soon as it begins to land it is sent back to what it flew: always refused, because a hover
    can't follow a landing that was broken off."""
    yield from _callback(
        mission, "event: V.behavior_started, behavior: DOWN, do: [{switch: {V: AIR}}]"
    )


@senseless
def callback_that_starts_the_state_anew(mission: Mission) -> Changes:
    """A state is entered again when it has ended: always refused, because the landing has begun."""
    yield from _callback(
        mission, "event: V.behavior_ended, behavior: AIR, do: [{switch: {V: AIR}}]"
    )


@senseless
def callback_that_rests_in_the_air(mission: Mission) -> Changes:
    """In the air it is switched to the built-in `landed`, which begins on the ground: refused."""
    yield from _callback(
        mission, "event: V.behavior_started, behavior: AIR, do: [{switch: {V: landed}}]"
    )


@dangerous
def callback_that_disables_the_fence(mission: Mission) -> Changes:
    """The fence is switched off in flight."""
    yield from _callback(mission, "event: V.took_off, do: [{disable: V.processors.fence}]")


@senseless
def callback_that_sets_a_wild_speed(mission: Mission) -> Changes:
    """`limit_speed` is set to 40 m/s in flight: it limits nothing."""
    yield from _callback(
        mission, "event: V.took_off, do: [{set: {V.processors.limit_speed.speed: 40 m/s}}]"
    )


@dangerous
def callback_that_loosens_a_supervisor(mission: Mission) -> Changes:
    """A supervisor's margin is widened in flight."""
    yield from _callback(
        mission, "event: V.took_off, do: [{set: {V.supervisors.fence.margin: 50 m}}]"
    )


@senseless
def stopped_at_its_take_off(mission: Mission) -> Changes:
    """`stop` as soon as it has taken off: nothing of the mission is flown."""
    yield from _callback(mission, "event: V.took_off, do: [{stop: done}]")


@senseless
def text_with_a_field_that_is_not_there(mission: Mission) -> Changes:
    """`{altitude}` in a text: the event carries no such thing."""
    yield from _callback(mission, 'event: V.took_off, do: [{log: "at {altitude}"}]')


@senseless
def fault_with_another_condition(mission: Mission) -> Changes:
    """The fault of a state is moved behind the end of that state: never injected."""
    for fault in mission.items("faults"):
        when = mission.at("when", of=fault)
        if when is not None and "elapsed" in when.value:
            left = when.value.rpartition("elapsed")[0]
            yield change(put(when, f"{left}elapsed > 50 min"))
