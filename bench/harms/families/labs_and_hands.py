"""The lab's air, AR.Drones, inputs, options set in flight, and expectations beside a fault: what
people write wrong of each."""

from __future__ import annotations

from harms.families.formations import phases, told
from harms.mission_text import Mission, add_last, everywhere, own_list, own_section, put
from harms.operator import Changes, change, dangerous, senseless


def _lab(mission: Mission, text: str) -> Changes:
    """The mission on `sim` with another parameter of its lab, where it has no targets."""
    if mission.at("targets") is None:
        for vehicle in mission.own():
            driver = f"{{{vehicle.name}: {{driver: {{use: sim, {text}}}}}}}"
            yield change(own_section(mission, "targets", f"sim: {driver}"))


@dangerous
def a_storm_in_the_lab(mission: Mission) -> Changes:
    """A steady wind of 30 m/s, where 30 cm/s were meant: it is blown through the fence."""
    yield from _lab(mission, "wind: [30, 0, 0]")


@dangerous
def gusts_of_a_storm(mission: Mission) -> Changes:
    """Gusts of 10 m/s, where 10 cm/s were meant."""
    yield from _lab(mission, "gust: 10 m/s")


@dangerous
def eddies_stronger_than_a_tilt(mission: Mission) -> Changes:
    """Random forces of half a g push it about."""
    yield from _lab(mission, "force_noise: 5 m/s^2")


def _drones(mission: Mission, text: str) -> Changes:
    """The mission's AR.Drones in a lab, with another parameter of their driver."""
    for name, _ in mission.pairs("targets", "lab"):
        driver = mission.at("targets", "lab", name.value, "driver")
        if driver is not None and mission.word("use", of=driver) == "ardrone":
            yield change(add_last(driver, text), target="lab")


@dangerous
def a_ceiling_below_the_flight(mission: Mission) -> Changes:
    """The drone keeps itself below 60 cm, and the mission flies higher."""
    yield from _drones(mission, "altitude_max: 60 cm")


@dangerous
def hardly_any_tilt(mission: Mission) -> Changes:
    """A full command tilts by 1 deg: it can't hold its circle."""
    yield from _drones(mission, "euler_angle_max: 1 deg")


@senseless
def hardly_any_climb(mission: Mission) -> Changes:
    """A full command climbs with 20 cm/s, and the mission climbs faster."""
    yield from _drones(mission, "control_vz_max: 0.2 m/s")


@dangerous
def another_body_as_an_ardrone(mission: Mission) -> Changes:
    """The airframe of an X500 on the driver of an AR.Drone: all gains are wrong."""
    for vehicle in mission.own() if mission.at("targets", "lab") is not None else ():
        like = mission.at("like", of=vehicle.node)
        if like is not None and mission.word("like", of=vehicle.node) == "std.ardrone":
            nodes = [node for pair in mission.pairs("targets", "lab") for node in pair]
            yield change(put(like, "std.x500"), also=(vehicle.key, *nodes), target="lab")


@senseless
def climbs_beyond_the_airframe(mission: Mission) -> Changes:
    """A full stick climbs with 10 m/s, which no vehicle here can."""
    yield from told(mission, "climb", "10 m/s", "steer", "formation")


@dangerous
def turns_like_a_drill(mission: Mission) -> Changes:
    """A full stick turns by 5000 deg/s, where 50 were meant."""
    yield from told(mission, "turn_rate", "5000 deg/s", "steer", "formation")


@senseless
def turns_like_a_sundial(mission: Mission) -> Changes:
    """A full stick turns by 0.1 deg/s: an hour a turn."""
    yield from told(mission, "turn_rate", "0.1 deg/s", "steer", "formation")


@senseless
def lowest_is_the_highest(mission: Mission) -> Changes:
    """It may not be below 2 m, and is entered at 1 m."""
    yield from told(mission, "lowest", "2 m", "steer", "formation")


@senseless
def waits_longer_than_the_mission(mission: Mission) -> Changes:
    """It waits 20 min for a lost input, longer than the run lasts."""
    yield from told(mission, "patience", "20 min", "steer", "formation")


_BUTTONS = ("a", "b", "x", "y", "start", "back", "dpad_up", "dpad_down", "left_stick")


def _device(mission: Mission, text: str) -> Changes:
    """A steering input of another kind, whose buttons are those that the mission hears."""
    words = [n.value for key, n in everywhere(mission.root) if key.value == "event"]
    for name, node in mission.pairs("inputs"):
        heard = sorted({w.partition(".")[2] for w in words if w.startswith(f"{name.value}.")})
        if mission.word("use", of=node) == "script" and heard:
            buttons = ", ".join(f"{b}: {key}" for b, key in zip(heard, _BUTTONS, strict=False))
            yield change(put(node, f"{{use: gamepad, buttons: {{{buttons}}}, {text}}}"))


@dangerous
def one_stick_for_two_axes(mission: Mission) -> Changes:
    """The same stick moves forward and up."""
    yield from _device(mission, "z: -right_y")


@senseless
def an_axis_of_another_pad(mission: Mission) -> Changes:
    """An axis that no gamepad has."""
    yield from _device(mission, "x: rigth_y")


@senseless
def another_formation_for_one(mission: Mission) -> Changes:
    """One member flies another side length, so that they wait for each other."""
    for state in mission.states("formation"):
        group = mission.plan.groups.get(mission.word("members", of=state.node), ())
        for vehicle in mission.vehicles():
            is_like = mission.word("like", of=vehicle.node) == state.vehicle
            own = mission.at("behaviors", of=vehicle.node)
            if vehicle.name in group and is_like and own is None:
                text = f"behaviors: {{{state.name}: {{side: 3.3 m}}}}"
                yield change(add_last(vehicle.node, text), also=(state.key,))


@dangerous
def the_leader_follows_its_follower(mission: Mission) -> Changes:
    """Both follow each other, in the phase in which one should."""
    for state in mission.states("follow"):
        leader = mission.word("vehicle", of=state.node)
        own = next(v for v in mission.vehicles() if v.name == leader)
        behaviors = mission.at("behaviors", of=own.node)
        for key, phase, _, what in phases(mission):
            run = mission.at("run", of=phase)
            if behaviors is not None and run is not None and what == state.name:
                chase = f"chase: {{do: follow, vehicle: {state.vehicle}, failed: down}}"
                edits = add_last(behaviors, chase), add_last(run, f"{leader}: chase")
                yield change(*edits, also=(state.key, key))


def _set(mission: Mission, option: str) -> Changes:
    """An option is set after the take-off, where no flow has its own settings."""
    for vehicle in mission.own():
        name = f"{vehicle.name}.{option}"
        text = f"{{event: {vehicle.name}.took_off, do: [{{set: {{{name}}}}}]}}"
        yield change(own_list(mission, "on", text))


@dangerous
def no_tilt_left_in_flight(mission: Mission) -> Changes:
    """In flight the tracker may tilt by 0.1 deg: it can't be moved or stopped any more."""
    yield from _set(mission, "tracker.tilt: 0.1 deg")


@senseless
def no_speed_left_in_flight(mission: Mission) -> Changes:
    """In flight the speed is limited to 1 mm/s: it arrives nowhere."""
    yield from _set(mission, "processors.limit_speed.speed: 1 mm/s")


def _beside_a_fault(mission: Mission, *lines: str) -> Changes:
    """Expectations in a mission that has faults, late ones for all that is known of them."""
    for vehicle in mission.own() if mission.items("faults") else ():
        for line in lines:
            yield change(own_list(mission, "expect", line.replace("V", vehicle.name)))


@senseless
def never_up_beside_a_fault(mission: Mission) -> Changes:
    """It never gets higher than 20 cm, in a mission that takes off before the fault."""
    yield from _beside_a_fault(mission, "max(V.state.altitude) < 20 cm")


@senseless
def two_ends_beside_a_fault(mission: Mission) -> Changes:
    """It ends in `fault`, in a mission that expects it to land."""
    for vehicle in mission.own() if mission.items("faults") else ():
        also = tuple(mission.expectations(f"finally {vehicle.name} in landed"))
        if also:
            yield change(own_list(mission, "expect", f"finally {vehicle.name} in fault"), also=also)


@senseless
def an_error_between_two_bounds(mission: Mission) -> Changes:
    """The largest error is below the least: of the same state, with or without faults."""
    for node in mission.expectations("max(", "position_error", "in ", "<"):
        left = node.value.partition(" < ")[0].replace("max(", "min(", 1)
        yield change(own_list(mission, "expect", f"{left} > 1 m"), also=(node,))


@senseless
def a_fault_that_nobody_feels(mission: Mission) -> Changes:
    """The messages to its neighbours are lost, of which nobody listens."""
    if not mission.states("formation", "follow"):
        for vehicle in mission.own():
            text = f"{{at: 5 s, on: {vehicle.name}, inject: neighbours_lost, for: 1 s}}"
            yield change(own_list(mission, "faults", text))


@senseless
def how_it_never_ends(mission: Mission) -> Changes:
    """A callback for behaviors that end `finished`, which is called `done`."""
    for vehicle in mission.own():
        text = f'{{event: {vehicle.name}.behavior_ended, how: finished, do: [{{log: "over"}}]}}'
        yield change(own_list(mission, "on", text))


@senseless
def a_crate_in_the_cellar(mission: Mission) -> Changes:
    """An obstacle whose height has the wrong sign."""
    obstacles = mission.at("world", "obstacles")
    if obstacles is not None:
        text = "crate_below: {box: {from: [-0.5, -0.5, -1], to: [0.5, 0.5, -0.2]}}"
        yield change(add_last(obstacles, text))


@senseless
def a_corner_twice(mission: Mission) -> Changes:
    """A corner of a path copied and not changed."""
    for state in mission.states("follow_path"):
        corners = mission.items("path", of=state.node)
        if len(corners) > 1:
            last = corners[-1]
            text = mission.text[last.start_mark.index : last.end_mark.index]
            yield change(put(last, f"{text}, {text}"))
