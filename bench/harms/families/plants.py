"""Airframes that can't be: a unit wrong, a factor of ten to a hundred; and gains that no loop of
this airframe carries."""

from __future__ import annotations

from harms.mission_text import Mission, Vehicle, add, own_section, put
from harms.operator import Changes, change, dangerous, senseless


def _airframe(mission: Mission, vehicle: Vehicle) -> str:
    like = mission.word("like", of=vehicle.node)
    return like if "." in like else ""


def _flying(mission: Mission, entry: str, *names: str) -> Changes:
    """Each vehicle flies an airframe of the mission that is like its own but for `entry`."""
    for vehicle in mission.own():
        like = _airframe(mission, vehicle)
        if names and like.partition(".")[2] not in names:
            continue
        edits = (
            own_section(mission, "airframes", f"changed: {{like: {like}, {entry}}}"),
            add(vehicle.node, "airframe: changed"),
        )
        yield change(*edits, also=(vehicle.key,))


def _scaled(mission: Mission, field: str, factor: float, unit: str) -> Changes:
    for vehicle in mission.own():
        value = getattr(mission.planned(vehicle.name).airframe, field)
        if isinstance(value, tuple):
            text = f"[{', '.join(f'{v * factor:g} {unit}' for v in value)}]"
        else:
            text = f"{value * factor:g} {unit}"
        entry = f"changed: {{like: {_airframe(mission, vehicle)}, {field}: {text}}}"
        edits = own_section(mission, "airframes", entry), add(vehicle.node, "airframe: changed")
        yield change(*edits, also=(vehicle.key,))


@dangerous
def mass_in_grams(mission: Mission) -> Changes:
    """`mass: 230 kg` for `230 g`: its rotors can't lift a hundredth of it."""
    yield from _scaled(mission, "mass", 1000.0, "kg")


@senseless
def mass_a_twentieth(mission: Mission) -> Changes:
    """A mass of a twentieth: it expects to hover on a twentieth of its thrust, and never lifts
    off."""
    yield from _scaled(mission, "mass", 0.05, "kg")


@dangerous
def inertia_a_hundred_times(mission: Mission) -> Changes:
    """Inertia in kg cm^2-like figures: with its thrust it turns a hundred times too slowly."""
    yield from _scaled(mission, "inertia", 100.0, "kg m^2")


@dangerous
def inertia_a_thousandth(mission: Mission) -> Changes:
    """Inertia of a coin for a vehicle of its mass and size."""
    yield from _scaled(mission, "inertia", 0.001, "kg m^2")


@dangerous
def rotors_of_a_ship(mission: Mission) -> Changes:
    """A rotor time of seconds for milliseconds: no attitude is held with it."""
    yield from _scaled(mission, "rotor_time", 50.0, "s")


@senseless
def torque_ratio_in_metres(mission: Mission) -> Changes:
    """`torque_ratio: 1.6 m` for `1.6 cm`: a rotor drags a hundred times too much."""
    yield from _scaled(mission, "torque_ratio", 100.0, "m")


@dangerous
def thrust_too_small(mission: Mission) -> Changes:
    """The thrust of all rotors given as a fourth of a fourth: it doesn't lift the vehicle."""
    yield from _scaled(mission, "thrust", 0.2, "N")


@senseless
def thrust_in_grams(mission: Mission) -> Changes:
    """`thrust: 130 N`, grams in mind: a hundred times what rotors of this size give, so that what
    it takes for hovering lifts nothing."""
    yield from _scaled(mission, "thrust", 100.0, "N")


@dangerous
def diameter_in_millimetres(mission: Mission) -> Changes:
    """`diameter: 0.19 mm`-like: vehicles and pillars may be touched, by what it believes."""
    yield from _scaled(mission, "diameter", 0.001, "m")


@senseless
def diameter_of_a_hall(mission: Mission) -> Changes:
    """A diameter of ten times its own: it doesn't fit into the room."""
    yield from _scaled(mission, "diameter", 20.0, "m")


@dangerous
def endurance_in_seconds(mission: Mission) -> Changes:
    """`endurance: 10 s` for `10 min`: the battery is empty before it has climbed."""
    yield from _flying(mission, "endurance: 10 s")


@dangerous
def drag_of_a_parachute(mission: Mission) -> Changes:
    """`drag: 60 1/s`: at 0.5 m/s it would need three times its weight against the air."""
    yield from _flying(mission, "drag: 60 1/s")


@dangerous
def loop_on_board_that_shakes(mission: Mission) -> Changes:
    """An attitude gain of 40 1/s over a rate gain of 5 1/s: the loop on board oscillates."""
    yield from _flying(mission, "attitude_gain: 40 1/s, rate_gain: 5 1/s")


def _tracked(mission: Mission, tracker: str) -> Changes:
    for vehicle in mission.own():
        own = mission.at("tracker", of=vehicle.node)
        yield change(put(own, tracker) if own else add(vehicle.node, f"tracker: {tracker}"))


@dangerous
def gains_ten_times(mission: Mission) -> Changes:
    """`geometric` with ten times its gains: it oscillates and falls."""
    gains = "proportional: 160, derivative: 90, integral: 80"
    yield from _tracked(mission, f"{{use: geometric, {gains}}}")


@dangerous
def cascade_gains_ten_times(mission: Mission) -> Changes:
    """`cascade` with ten times its gains: it oscillates and falls."""
    gains = "proportional: 90, derivative: 75, integral: 45"
    yield from _tracked(mission, f"{{use: cascade, {gains}}}")


@dangerous
def gains_a_twentieth(mission: Mission) -> Changes:
    """`cascade` with a twentieth of its gains and all of its integral: it swings further and
    further."""
    gains = "proportional: 0.45, derivative: 0.375, integral: 4.5"
    yield from _tracked(mission, f"{{use: cascade, {gains}}}")


@dangerous
def integral_alone_twenty_times(mission: Mission) -> Changes:
    """`integral: 90` of `cascade`, beside 9 and 7.5: a loop without damping."""
    yield from _tracked(mission, "{use: cascade, integral: 90, integral_limit: 10 m/s^2}")


@dangerous
def hardly_any_damping(mission: Mission) -> Changes:
    """`derivative: 0.3` beside a proportional of 9: it swings further and further."""
    yield from _tracked(mission, "{use: cascade, derivative: 0.3}")


@dangerous
def velocity_gains_ten_times(mission: Mission) -> Changes:
    """`velocity` with ten times its damping and integral: it oscillates and falls."""
    yield from _tracked(mission, "{use: velocity, derivative: 75, integral: 45}")


@senseless
def tracker_that_may_not_tilt(mission: Mission) -> Changes:
    """`tilt: 0.1 deg`: it can't move to the side, and a draught takes it away."""
    yield from _tracked(mission, "{use: cascade, tilt: 0.1 deg}")


@dangerous
def payload_too_heavy(mission: Mission) -> Changes:
    """A parcel of 5 kg under a vehicle that lifts itself twice."""
    for vehicle in mission.own():
        if mission.planned(vehicle.name).payload is not None:
            yield change(add(vehicle.node, "payload: {mass: 5 kg, size: 10 cm}"))


@dangerous
def payload_too_large(mission: Mission) -> Changes:
    """A parcel with sides of 1 m under a vehicle of 0.55 m."""
    for vehicle in mission.own():
        if mission.planned(vehicle.name).payload is not None:
            yield change(add(vehicle.node, "payload: {mass: 200 g, size: 1 m}"))


@dangerous
def airframe_without_thrust(mission: Mission) -> Changes:
    """An airframe of the mission's own that has forgotten its rotors' thrust."""
    for vehicle in mission.own():
        entry = (
            "changed: {mass: 1 kg, diameter: 0.5 m, inertia: [0.01, 0.01, 0.02], rotor_time: 50 ms}"
        )
        for key, value in mission.pairs(of=vehicle.node):
            if key.value == "like":
                edit = put(key, "airframe: changed")._replace(end=value.end_mark.index)
                yield change(own_section(mission, "airframes", entry), edit, also=(vehicle.key,))
