"""Vehicles that fly together: formations that are too narrow, followers too close, news that are
too old, members that lack what the others do, arrivals and acts."""

from __future__ import annotations

from collections.abc import Iterator

from harms.mission_text import (
    Mission,
    Node,
    State,
    add,
    add_last,
    own_list,
    own_section,
    put,
    with_key,
)
from harms.operator import Changes, change, dangerous, senseless

TOGETHER = ("formation", "follow")


def told(mission: Mission, key: str, text: str, *parts: str) -> Changes:
    """Each behavior of these parts with another value of a parameter."""
    for state in mission.states(*parts):
        yield change(with_key(mission, state.node, key, text))


@dangerous
def side_below_the_rotors(mission: Mission) -> Changes:
    """Places 20 cm from each other, less than two vehicles are wide."""
    yield from told(mission, "side", "20 cm", "formation")


@dangerous
def side_within_what_proximity_allows(mission: Mission) -> Changes:
    """Places 50 cm from each other: the vehicles just fit, and `proximity` brakes them all."""
    yield from told(mission, "side", "50 cm", "formation")


@senseless
def side_wider_than_the_fence(mission: Mission) -> Changes:
    """Places 15 m from each other, in a room of a few metres."""
    yield from told(mission, "side", "15 m", "formation")


@dangerous
def two_places_in_one(mission: Mission) -> Changes:
    """A formation by points, two of which are the same."""
    for state in mission.states("formation"):
        if mission.at("points", of=state.node) is not None:
            continue
        group = mission.plan.groups.get(mission.word("members", of=state.node), ())
        points = ", ".join(f"[{1.5 * (i // 2):g}, 0, 0]" for i in range(len(group)))
        yield change(add_last(state.node, f"points: [{points}]"))


@dangerous
def a_place_under_another(mission: Mission) -> Changes:
    """A formation by points that are 40 cm above each other, in each other's downwash."""
    for state in mission.states("formation"):
        if mission.at("points", of=state.node) is not None:
            continue
        group = mission.plan.groups.get(mission.word("members", of=state.node), ())
        points = ", ".join(f"[0, 0, {0.4 * i:g}]" for i in range(len(group)))
        yield change(add_last(state.node, f"points: [{points}]"))


@senseless
def a_shape_for_another_number(mission: Mission) -> Changes:
    """A square of three, a triangle of four."""
    for state in mission.states("formation"):
        own = mission.at("shape", of=state.node)
        if own is not None:
            yield change(put(own, "square" if own.value == "triangle" else "triangle"))


@senseless
def a_member_lacks_the_formation(mission: Mission) -> Changes:
    """One of the group has no such behavior; the others wait for it."""
    for state in mission.states("formation"):
        for vehicle in mission.vehicles():
            is_member = vehicle.name in mission.plan.groups.get(
                mission.word("members", of=state.node), ()
            )
            is_like = mission.word("like", of=vehicle.node) == state.vehicle
            own = mission.at("behaviors", of=vehicle.node)
            entry = f"{state.name}: null"
            if is_member and is_like and (own is None or mission.at(state.name, of=own) is None):
                edit = add(own, entry) if own else add_last(vehicle.node, f"behaviors: {{{entry}}}")
                yield change(edit, also=(state.key, state.node))


@dangerous
def a_silent_one_is_noticed_late(mission: Mission) -> Changes:
    """News of five seconds ago count as new: for so long all fly on beside one that is lost."""
    yield from told(mission, "freshness", "5 s", *TOGETHER)


@senseless
def nobody_is_ever_heard(mission: Mission) -> Changes:
    """News are too old after 5 ms, and arrive after 20 ms."""
    yield from told(mission, "freshness", "5 ms", *TOGETHER)


@senseless
def news_arrive_stale(mission: Mission) -> Changes:
    """News arrive after 380 ms, and are too old after 300 ms."""
    yield from told(mission, "delay", "380 ms", *TOGETHER)


@dangerous
def nobody_is_waited_for(mission: Mission) -> Changes:
    """`doubt: 500 m`, cm in mind: the formation goes on without one that is blown away."""
    yield from told(mission, "doubt", "500 m", "formation")


@dangerous
def no_room_kept_to_obstacles(mission: Mission) -> Changes:
    """Hubs may come within 1 cm of a pillar, with arms of more than 10 cm."""
    yield from told(mission, "clearance", "1 cm", "formation")


@senseless
def led_by_a_member(mission: Mission) -> Changes:
    """The formation follows one of its own, which follows it."""
    for state in mission.states("formation"):
        leader = mission.at("leader", of=state.node)
        if leader is not None:
            yield change(put(leader, state.vehicle), also=(state.node,))


@senseless
def follows_itself(mission: Mission) -> Changes:
    """The wingman's leader is the wingman."""
    for state in mission.states("follow"):
        leader = mission.at("vehicle", of=state.node)
        if leader is not None:
            yield change(put(leader, state.vehicle))


@dangerous
def follows_too_close(mission: Mission) -> Changes:
    """12 cm beside the leader, where the rotors overlap."""
    yield from told(mission, "offset", "[0, 0.12, 0]", "follow")


@dangerous
def follows_below(mission: Mission) -> Changes:
    """30 cm below the leader, in its downwash."""
    yield from told(mission, "offset", "[0, 0, -0.3]", "follow")


@dangerous
def the_leader_amid_the_formation(mission: Mission) -> Changes:
    """The leader flies where a member's place is."""
    for state in mission.states("formation"):
        offset = mission.at("offset", of=state.node)
        if offset is not None:
            yield change(put(offset, "[-0.69, 0, 0]"), also=(state.key,))


@senseless
def follows_outside_the_fence(mission: Mission) -> Changes:
    """Its place is 23 m behind the leader, in a room of 8 m."""
    for state in mission.states(*TOGETHER):
        offset = mission.at("offset", of=state.node)
        if offset is not None:
            yield change(put(offset, "[-23, 0, 0]"), also=(state.key,))


@senseless
def waits_for_one_who_is_in_no_formation(mission: Mission) -> Changes:
    """A phase waits until the leader has settled, who flies a circle."""
    for flow, _ in mission.pairs("flows"):
        for _, phase in mission.pairs("flows", flow.value, "phases"):
            for way in mission.items("next", of=phase):
                event = mission.at("event", of=way)
                if event is not None and event.value.endswith(".formation_settled"):
                    yield change(put(event, "lead.formation_settled"))


def phases(mission: Mission) -> Iterator[tuple[Node, Node, str, str]]:
    """Key and node of the phases that run one thing of one group, the group and the thing."""
    for flow, _ in mission.pairs("flows"):
        for key, phase in mission.pairs("flows", flow.value, "phases"):
            for who, what in mission.pairs("run", of=phase)[:1]:
                yield key, phase, who.value, str(what.value)


def arriving(mission: Mission, how: str, *parts: str) -> Changes:
    """A phase whose vehicles, several, do one of these parts, arrives so."""
    goals: dict[str, State] = {s.name: s for s in mission.states(*parts)}
    for key, phase, who, what in phases(mission):
        if what in goals and len(mission.plan.groups.get(who, ())) > 1:
            yield change(add_last(phase, f"arrive: {how}"), also=(key, goals[what].key))


@senseless
def together_on_a_circle(mission: Mission) -> Changes:
    """They are to arrive together, and fly a circle, which keeps no common pace."""
    yield from arriving(mission, "together", "circle")


@senseless
def in_turns_into_a_formation(mission: Mission) -> Changes:
    """The first waits in the formation for the others, who wait for their turn."""
    yield from arriving(mission, "in_turns", "formation")


@senseless
def arrives_alone(mission: Mission) -> Changes:
    """A phase of one vehicle arrives in turns."""
    for key, phase, who, what in phases(mission):
        if who not in mission.plan.groups and what:
            yield change(add_last(phase, "arrive: in_turns"), also=(key,))


@dangerous
def corners_across(mission: Mission) -> Changes:
    """The corners of a square are exchanged across: all four meet in its middle."""
    own = {v.name: mission.at("behaviors", "corner", "position", of=v.node)
           for v in mission.vehicles()}  # fmt: skip
    if len(own) == 4 and all(own.values()):
        nodes = [node for node in own.values() if node is not None]
        texts = [mission.text[n.start_mark.index : n.end_mark.index] for n in nodes]
        yield change(*map(put, nodes, texts[2:] + texts[:2]))


@dangerous
def in_turns_through_each_other(mission: Mission) -> Changes:
    """Each flies in its turn to where another one still stands."""
    own = {v.name: mission.at("behaviors", "corner", "position", of=v.node)
           for v in mission.vehicles()}  # fmt: skip
    if len(own) == 4 and all(own.values()):
        nodes = [node for node in own.values() if node is not None]
        goals = [mission.planned(name).start for name in own]
        edits = [
            put(node, f"[{x:g}, {y:g}, 1]")
            for node, (x, y, _) in zip(nodes, goals[1:] + goals[:1], strict=True)
        ]
        for key, phase, _, what in phases(mission):
            if key.value == "gather" and what == "corner":
                yield change(*edits, add_last(phase, "arrive: in_turns"), also=(key,))


def acts(mission: Mission, who: str, act: str, target: str | None = None) -> Changes:
    """A callback that asks for an act when the first vehicle has taken off."""
    first = mission.plan.vehicles[0].name
    entry = f"{{event: {first}.took_off, do: [{{perform: {{{who or first}: {act}}}}}]}}"
    yield change(own_list(mission, "on", entry), target=target)


@senseless
def an_act_that_nobody_knows(mission: Mission) -> Changes:
    """It is asked for a looping."""
    yield from acts(mission, "", "loop_the_loop")


@senseless
def an_act_of_a_stranger(mission: Mission) -> Changes:
    """A vehicle of another mission is asked to blink."""
    yield from acts(mission, "drone7", "leds_fire")


@senseless
def an_animation_without_leave(mission: Mission) -> Changes:
    """A wave with a driver that was not told `maneuvers: true`: it is refused in flight."""
    if "std.ardrone" in mission.text:
        yield from acts(mission, "", "wave", target="emulated_ardrone")


@dangerous
def a_flip_low_above_the_ground(mission: Mission) -> Changes:
    """A flip as soon as it has taken off, by a driver that may: it falls down to the ground."""
    if "std.ardrone" in mission.text and mission.at("faults") is None:
        driver = "driver: {use: emulated_ardrone, maneuvers: true}"
        target = own_section(mission, "targets", f"flips: {{all: {{{driver}}}}}")
        first = mission.plan.vehicles[0].name
        entry = f"{{event: {first}.took_off, do: [{{perform: {{{first}: flip_left}}}}]}}"
        yield change(target, own_list(mission, "on", entry), target="flips")
