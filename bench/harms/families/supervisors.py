"""Supervisors that can never fire, such that fire at once, and reactions that do harm.

One that can never fire does harm on the day on which what it watches happens: a flight in which
nothing breaks shows nothing of it.
"""

from __future__ import annotations

from harms.mission_text import Mission, add, append
from harms.operator import Changes, change, dangerous, senseless


def _supervised(mission: Mission, entry: str) -> Changes:
    """Each vehicle with its own list, or without one, has one more supervisor."""
    for vehicle in mission.own():
        own = mission.at("supervisors", of=vehicle.node)
        if own is None and "lab." in mission.word("like", of=vehicle.node):
            continue  # its library has a list, which this would replace as a whole
        if own is None:
            yield change(add(vehicle.node, f"supervisors: [{{{entry}}}]"))
        elif "battery" not in entry:
            yield change(append(own, f"{{{entry}}}"))


def _processed(mission: Mission, *entries: str) -> Changes:
    """Each vehicle without a list of processors has this one."""
    for vehicle in mission.own():
        if mission.at("processors", of=vehicle.node) is None:
            edit = add(vehicle.node, f"processors: [{', '.join(entries)}]")
            yield change(edit, also=(vehicle.key,))


@dangerous
def battery_that_never_lands(mission: Mission) -> Changes:
    """`land_below: 0 %`: it flies until it falls."""
    yield from _supervised(mission, "use: battery, land_below: 0 %")


@senseless
def battery_that_lands_at_once(mission: Mission) -> Changes:
    """`land_below: 100 %`: below that from the first second on, so nothing is flown."""
    yield from _supervised(mission, "use: battery, land_below: 100 %, warn_below: 100 %")


@senseless
def warning_after_the_landing(mission: Mission) -> Changes:
    """It warns below 10 % and lands below 40 %: the warning never comes before."""
    yield from _supervised(mission, "use: battery, warn_below: 10 %, land_below: 40 %")


@dangerous
def link_silent_for_minutes(mission: Mission) -> Changes:
    """`link age: 10 min`: it flies on for as long as its battery lasts, and nobody hears it."""
    yield from _supervised(mission, "use: link, age: 10 min")


@senseless
def link_silent_for_a_moment(mission: Mission) -> Changes:
    """`link age: 1 ms`: less than from one packet of an autopilot to the next, so it fires at
    once."""
    yield from _supervised(mission, "use: link, age: 1 ms")


@dangerous
def estimate_an_hour_old(mission: Mission) -> Changes:
    """`estimate age: 1 h`-like: it flies on where it was long ago."""
    yield from _supervised(mission, "use: estimate, age: 60 min")


@senseless
def estimate_too_young(mission: Mission) -> Changes:
    """`estimate age: 1 ms`: less than from one pose to the next, so it fires at once."""
    yield from _supervised(mission, "use: estimate, age: 1 ms")


@dangerous
def estimate_anywhere(mission: Mission) -> Changes:
    """`spread: 100 m`, in a room of 6 m: it may be anywhere, and flies on."""
    yield from _supervised(mission, "use: estimate, spread: 100 m")


@senseless
def estimate_too_exact(mission: Mission) -> Changes:
    """`spread: 0.001 mm`: no motion capture is as exact, so it fires at once."""
    yield from _supervised(mission, "use: estimate, spread: 0.001 mm")


@dangerous
def fence_far_outside(mission: Mission) -> Changes:
    """A margin of 50 m beyond a fence of 6 m: it has hit the wall long before."""
    yield from _supervised(mission, "use: fence, margin: 50 m")


@dangerous
def tilt_upside_down(mission: Mission) -> Changes:
    """`tilt limit: 179 deg`: it lies on its back before that fires."""
    yield from _supervised(mission, "use: tilt, limit: 179 deg")


@senseless
def tilt_of_a_level(mission: Mission) -> Changes:
    """`tilt limit: 1 deg`: every move tilts more, so it fires at the first."""
    yield from _supervised(mission, "use: tilt, limit: 1 deg")


@dangerous
def spin_of_a_drill(mission: Mission) -> Changes:
    """`spin limit: 36000 deg/s`: a hundred turns a second, more than a gyroscope measures."""
    yield from _supervised(mission, "use: spin, limit: 36000 deg/s")


@dangerous
def jump_over_the_room(mission: Mission) -> Changes:
    """`jump at_least: 50 m`, 5 cm in mind: no jump in a room of 6 m is that wide."""
    yield from _supervised(mission, "use: jump, at_least: 50 m")


@dangerous
def setpoint_out_of_sight(mission: Mission) -> Changes:
    """A setpoint may be 100 m away, in a room of 6 m: nothing notices one that ran away."""
    yield from _supervised(mission, "use: setpoint, distance: 100 m, step: 100 m")


@dangerous
def ground_meters_away(mission: Mission) -> Changes:
    """`gap: 20 m` under a ceiling of 2.5 m: a vehicle that lies on the ground is never noticed."""
    yield from _supervised(mission, "use: ground, gap: 20 m")


@senseless
def proximity_of_the_room(mission: Mission) -> Changes:
    """5 m between vehicles in a room of 6 m: they brake as soon as they fly."""
    if len(mission.plan.vehicles) > 1:
        yield from _supervised(mission, "use: proximity, margin: 5 m")


@dangerous
def cut_for_a_low_battery(mission: Mission) -> Changes:
    """`reaction: cut` for 15 % of battery: it falls, where it could have landed."""
    yield from _supervised(mission, "use: battery, reaction: cut")


@dangerous
def cut_for_a_lost_link(mission: Mission) -> Changes:
    """`reaction: cut` for half a second without a link: it falls out of the air."""
    yield from _supervised(mission, "use: link, reaction: cut")


@dangerous
def cut_for_a_lost_estimate(mission: Mission) -> Changes:
    """`reaction: cut` when motion capture is lost: it falls, where it could come down blind."""
    yield from _supervised(mission, "use: estimate, reaction: cut")


@dangerous
def cut_for_closeness(mission: Mission) -> Changes:
    """`reaction: cut` when two come close: both fall."""
    if len(mission.plan.vehicles) > 1:
        yield from _supervised(mission, "use: proximity, reaction: cut")


@dangerous
def only_a_warning_without_estimate(mission: Mission) -> Changes:
    """`reaction: warn` when it doesn't know where it is: it flies on, anywhere."""
    yield from _supervised(mission, "use: estimate, reaction: warn")


@dangerous
def only_a_warning_outside(mission: Mission) -> Changes:
    """`reaction: warn` outside of the fence: it flies on into the wall."""
    yield from _supervised(mission, "use: fence, reaction: warn")


@dangerous
def only_a_warning_when_empty(mission: Mission) -> Changes:
    """`reaction: warn` below 15 % of battery: it flies until it falls."""
    yield from _supervised(mission, "use: battery, reaction: warn")


@dangerous
def error_of_a_room(mission: Mission) -> Changes:
    """`position_error` with a limit of 100 m, in a room of 6 m: it never fires."""
    entry = "{use: position_error, limit: 100 m}"
    yield from _processed(mission, "limit_speed", "limit_acceleration", "fence", entry)


@senseless
def error_of_a_hair(mission: Mission) -> Changes:
    """`position_error` with a limit of 1 mm: every move is further off, so it fires at once."""
    entry = "{use: position_error, limit: 1 mm}"
    yield from _processed(mission, "limit_speed", "limit_acceleration", "fence", entry)


@senseless
def fence_without_inside(mission: Mission) -> Changes:
    """A margin of 5 m kept from a fence of 6 m: nothing is left inside."""
    entry = "{use: fence, margin: 5 m}"
    yield from _processed(mission, "limit_speed", "limit_acceleration", entry, "position_error")


@dangerous
def no_processor_keeps_the_fence(mission: Mission) -> Changes:
    """A list of processors without the fence: nothing holds the setpoint inside any more."""
    yield from _processed(mission, "limit_speed", "limit_acceleration")


@senseless
def speed_of_a_snail(mission: Mission) -> Changes:
    """`limit_speed: 1 mm/s`: a metre takes a quarter of an hour, and every goal fails."""
    entry = "{use: limit_speed, speed: 1 mm/s}"
    if mission.states("fly_to", "follow_path", "circle", "figure_eight"):
        yield from _processed(mission, entry, "limit_acceleration", "fence", "position_error")


@senseless
def speed_without_limit(mission: Mission) -> Changes:
    """`limit_speed: 100 m/s` on an airframe for 1 m/s: it limits nothing."""
    entry = "{use: limit_speed, speed: 100 m/s}"
    yield from _processed(mission, entry, "limit_acceleration", "fence", "position_error")


@senseless
def smoothed_for_ever(mission: Mission) -> Changes:
    """`settle: 20 min`: setpoints that come twenty minutes late."""
    entry = "{use: smooth, settle: 20 min}"
    yield from _processed(mission, entry, "limit_acceleration", "fence", "position_error")
