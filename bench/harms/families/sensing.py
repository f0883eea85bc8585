"""Estimators and sensors: cameras that see nothing, health that is never or always true."""

from __future__ import annotations

from harms.families.physics import way_out
from harms.mission_text import Mission, add, own_section, put
from harms.operator import Changes, change, dangerous, senseless


def _camera(mission: Mission, entry: str) -> Changes:
    """Each courier flies an airframe whose camera is another."""
    for vehicle in mission.own():
        like = mission.word("like", of=vehicle.node)
        if mission.planned(vehicle.name).cameras:
            changed = f"changed: {{like: {like}, cameras: {{down: {{{entry}}}}}}}"
            edits = (
                own_section(mission, "airframes", changed),
                add(vehicle.node, "airframe: changed"),
            )
            yield change(*edits, also=(vehicle.key,))


@senseless
def camera_of_one_hertz(mission: Mission) -> Changes:
    """A frame a second, where an estimate of 250 ms is too old already."""
    yield from _camera(mission, "rate: 1 Hz")


@senseless
def camera_through_a_straw(mission: Mission) -> Changes:
    """A view of 3 deg: from 1.2 m it sees 6 cm of the floor, and tags of 19.5 cm never whole."""
    yield from _camera(mission, "field_of_view: 3 deg")


@senseless
def camera_that_looks_up(mission: Mission) -> Changes:
    """`facing: up`: the tags are on the floor."""
    yield from _camera(mission, "facing: up")


@senseless
def camera_that_looks_forward(mission: Mission) -> Changes:
    """`facing: forward`: on the pad it sees the wall, where no tags are."""
    yield from _camera(mission, "facing: forward")


@senseless
def camera_metres_away(mission: Mission) -> Changes:
    """`at: [11, 0, 15]` in metres, centimetres in mind: each place is metres off by each degree."""
    yield from _camera(mission, "at: [11, 0, 15]")


@senseless
def camera_of_few_pixels(mission: Mission) -> Changes:
    """16 by 16 pixels: no tag is read."""
    yield from _camera(mission, "width: 16, height: 16")


def _tags(mission: Mission, tags: str) -> Changes:
    world = mission.at("world")
    if world is not None and world.id == "scalar" and "tag_floor" in world.value:
        yield change(put(world, f"{{like: {world.value}, tags: {tags}}}"))


@dangerous
def tags_only_on_the_pad(mission: Mission) -> Changes:
    """The floor's tags are gone, those of the pad stay: on its way it sees none."""
    yield from _tags(mission, "{floor: null}")


@dangerous
def tags_of_two_millimetres(mission: Mission) -> Changes:
    """Tags of 2 mm for 20 cm, as a wrong unit makes them: none is read from 1.2 m."""
    yield from _tags(mission, "{floor: {grid: {size: 2 mm, spacing: 1 mm}}}")


@dangerous
def tags_in_the_next_room(mission: Mission) -> Changes:
    """The grid's centre 10 m away: no tag is where it flies."""
    yield from _tags(mission, "{floor: {grid: {at: [10, 10, 0]}}}")


@dangerous
def one_row_of_tags(mission: Mission) -> Changes:
    """One row of tags for ten: it leaves them after a step."""
    yield from _tags(mission, "{floor: {grid: {count: [10, 1], leave_out: []}}}")


def _estimators(mission: Mission, text: str) -> Changes:
    for vehicle in mission.own():
        own = mission.at("estimators", of=vehicle.node)
        if own is None or own.flow_style:
            yield change(add(vehicle.node, f"estimators: {text}"))


def _with_mocap(mission: Mission, text: str) -> Changes:
    if not any(v.cameras for v in mission.plan.vehicles):
        yield from _estimators(mission, text)


@dangerous
def tags_without_a_camera(mission: Mission) -> Changes:
    """`tag_camera` on an airframe that has no camera: there is never an estimate."""
    yield from _with_mocap(mission, "[{use: tag_camera, healthy: age < 300 ms}]")


@dangerous
def dead_reckoning_alone(mission: Mission) -> Changes:
    """`inertial` alone: it never knows where it is, and drifts by metres in seconds."""
    yield from _with_mocap(mission, "[{use: inertial}]")


@dangerous
def dead_reckoning_first(mission: Mission) -> Changes:
    """`inertial` before `mocap`: it flies on dead reckoning while motion capture is there."""
    first = "{use: inertial, healthy: spread < 10 m}"
    yield from _with_mocap(mission, f"[{first}, {{use: mocap, healthy: age < 250 ms}}]")


@senseless
def dead_reckoning_for_minutes(mission: Mission) -> Changes:
    """`for_at_most: 10 min` of dead reckoning with any spread: metres off after some seconds, which
    the supervisor of the estimate ends long before."""
    second = "{use: inertial, healthy: spread < 30 m, for_at_most: 10 min}"
    yield from _with_mocap(mission, f"[{{use: mocap, healthy: age < 250 ms}}, {second}]")


@senseless
def healthy_never(mission: Mission) -> Changes:
    """`age < 1 ms`, less than from one pose to the next: the estimator is never used."""
    yield from _with_mocap(mission, "[{use: mocap, healthy: age < 1 ms}]")


@senseless
def spread_never(mission: Mission) -> Changes:
    """`spread < 0.001 mm`: no motion capture is as exact, so the estimator is never used."""
    yield from _with_mocap(mission, "[{use: mocap, healthy: spread < 0.001 mm}]")


@senseless
def healthy_always(mission: Mission) -> Changes:
    """`age < 60 min`: a pose of an hour ago counts as healthy, so dead reckoning never helps."""
    second = "{use: inertial, for_at_most: 3 s}"
    yield from _with_mocap(mission, f"[{{use: mocap, healthy: age < 60 min}}, {second}]")


@senseless
def never_recovered(mission: Mission) -> Changes:
    """`recover_after: 60 min`: once lost, motion capture is never used again."""
    first = "{use: mocap, healthy: age < 250 ms, recover_after: 60 min}"
    yield from _with_mocap(mission, f"[{first}, {{use: inertial, for_at_most: 3 s}}]")


def _simulated(mission: Mission, entry: str) -> Changes:
    if mission.at("targets") is None and not any(v.cameras for v in mission.plan.vehicles):
        yield change(
            own_section(mission, "targets", f"sim: {{all: {{driver: {{use: sim, {entry}}}}}}}")
        )


@dangerous
def motion_capture_of_one_hertz(mission: Mission) -> Changes:
    """A pose a second: an estimate of 300 ms is too old, so it comes down blind."""
    yield from _simulated(mission, "mocap_rate: 1 Hz")


@dangerous
def motion_capture_a_second_late(mission: Mission) -> Changes:
    """Poses that are a second late: too old for the estimate's supervisor."""
    yield from _simulated(mission, "mocap_latency: 1 s")


@senseless
def motion_capture_of_a_metre(mission: Mission) -> Changes:
    """Poses with a noise of 1 m in a room of 6 m: never an estimate, so nothing is flown."""
    yield from _simulated(mission, "mocap_position_noise: 1 m")


@senseless
def event_of_a_camera_that_is_not_there(mission: Mission) -> Changes:
    """It waits for `tags_lost` on a vehicle that has no camera: never told."""
    for state in mission.flying():
        if not mission.planned(state.vehicle).cameras:
            yield change(way_out(mission, state, "event: tags_lost"))


@senseless
def sticks_that_nobody_has(mission: Mission) -> Changes:
    """`sticks.throttle > 0.5` in a simulation that has no transmitter: never true."""
    for state in mission.flying():
        yield change(way_out(mission, state, "when: sticks.throttle > 0.5"))


@senseless
def estimator_that_it_does_not_have(mission: Mission) -> Changes:
    """`estimator == tag_camera` on a vehicle that flies on motion capture alone: never true."""
    for state in mission.flying():
        if not mission.planned(state.vehicle).cameras:
            yield change(way_out(mission, state, "when: estimator == tag_camera"))
