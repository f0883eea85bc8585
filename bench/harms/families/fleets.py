"""Several vehicles: places that two have, ways that meet, waits for each other, flows that don't
end."""

from __future__ import annotations

from itertools import pairwise

from harms.mission_text import Mission, Node, add, drop, own_section, put
from harms.operator import Changes, change, dangerous, senseless


def _starts(mission: Mission) -> list[tuple[str, Node]]:
    found = ((v.name, mission.at("start", "at", of=v.node)) for v in mission.vehicles())
    return [(name, node) for name, node in found if node is not None]


def _place(point: tuple[float, ...], up: float = 0.0) -> str:
    return f"[{point[0]:g}, {point[1]:g}, {point[2] + up:g}]"


@dangerous
def one_start_for_two(mission: Mission) -> Changes:
    """The start was copied: two vehicles stand in each other."""
    starts = _starts(mission)
    for (_, first), (_, second) in pairwise(starts):
        yield change(put(second, mission.source(first)), also=(first,))


@dangerous
def starts_too_near(mission: Mission) -> Changes:
    """Two starts 10 cm apart: their rotors overlap."""
    starts = _starts(mission)
    for (name, first), (_, second) in pairwise(starts):
        x, y, z = mission.planned(name).start
        yield change(put(second, _place((x + 0.1, y, z))), also=(first,))


@dangerous
def one_landing_place_for_two(mission: Mission) -> Changes:
    """All land on one point: the second on the first."""
    if len(mission.plan.vehicles) < 2:
        return
    lands = [s for s in mission.states("land") if mission.at("position", of=s.node) is None]
    if lands and (len(lands) > 1 or mission.text.count("*") or mission.text.count("like: a")):
        edits = [add(s.node, "position: [0, 0, 0]") for s in lands]
        yield change(*edits)


@dangerous
def lands_on_the_others_start(mission: Mission) -> Changes:
    """One lands where the other stands or comes down again."""
    lands = {s.vehicle: s for s in mission.states("land")}
    names = [v.name for v in mission.plan.vehicles]
    if len(names) == 2 and len(lands) == 2:
        for own, other in (names, names[::-1]):
            if _ends_over_its_start(mission, other):
                place = f"position: {_place(mission.planned(other).start)}"
                yield change(add(lands[own].node, place), also=(lands[other].key,))


def _ends_over_its_start(mission: Mission, vehicle: str) -> bool:
    return not any(s.vehicle == vehicle for s in mission.states("fly_to"))


@dangerous
def head_on(mission: Mission) -> Changes:
    """Two change places at one height along one line, at the same time."""
    moves = {s.vehicle: s for s in mission.states("fly_to", "follow_path")}
    names = [v.name for v in mission.plan.vehicles]
    if len(names) == 2 and len(moves) == 2:
        edits = []
        for own, other in (names, names[::-1]):
            place = mission.planned(other).start
            key = "position" if moves[own].do == "fly_to" else "path"
            node = mission.at(key, of=moves[own].node)
            text = _place(place, 1.0) if key == "position" else f"[{_place(place, 1.0)}]"
            if node is None:
                return
            edits.append(put(node, text))
        yield change(*edits)


@dangerous
def one_goal_for_two(mission: Mission) -> Changes:
    """Both fly to one point."""
    moves = [s for s in mission.states("fly_to") if mission.at("position", of=s.node)]
    for first, second in pairwise(moves):
        own = mission.at("position", of=first.node)
        other = mission.at("position", of=second.node)
        if first.vehicle != second.vehicle and own and other:
            yield change(put(other, mission.source(own)), also=(own,))


@dangerous
def one_corner_for_two(mission: Mission) -> Changes:
    """The slot of a neighbour, copied and not changed: two in one place of the formation."""
    found = [
        (v, mission.at("behaviors", "corner", "position", of=v.node)) for v in mission.vehicles()
    ]
    slots = [node for _, node in found if node is not None]
    for first, second in pairwise(slots):
        yield change(put(second, mission.source(first)), also=(first,))


@dangerous
def one_above_the_other(mission: Mission) -> Changes:
    """A slot 30 cm above the neighbour's: in the air that it blows down, and too close."""
    found = [
        (v, mission.at("behaviors", "corner", "position", of=v.node)) for v in mission.vehicles()
    ]
    slots = [node for _, node in found if node is not None]
    for first, second in pairwise(slots):
        x, y, z = (n.value for n in first.value)
        yield change(put(second, f"[{x}, {y}, {float(z) + 0.3:g}]"), also=(first,))


@senseless
def waits_for_each_other(mission: Mission) -> Changes:
    """Each stays on the ground until the other flies: nobody ever does."""
    ups = {s.vehicle: s for s in mission.states("take_off")}
    names = [v.name for v in mission.plan.vehicles]
    own = [mission.at("behaviors", of=v.node) for v in mission.own()]
    if len(names) == 2 and len(ups) == 2 and all(own):
        edits = []
        for name, other, node in zip(names, names[::-1], own, strict=True):
            way = f"{{when: {other}.state.altitude > 50 cm, go: {ups[name].name}}}"
            if node is not None:
                edits.append(add(node, f"ready: {{do: wait_on_ground, next: [{way}]}}"))
        yield change(*edits)


@senseless
def waits_for_one_who_never_flies(mission: Mission) -> Changes:
    """It waits until the other is over 10 m, under a ceiling of 2.5 m."""
    names = [v.name for v in mission.plan.vehicles]
    for state in mission.states("take_off"):
        other = next((n for n in names if n != state.vehicle), None)
        behaviors = mission.at("vehicles", state.vehicle, "behaviors")
        if other and behaviors is not None and behaviors.value and mission.at("flows") is None:
            way = f"{{when: {other}.state.altitude > 10 m, go: {state.name}}}"
            yield change(add(behaviors, f"ready: {{do: wait_on_ground, next: [{way}]}}"))


def _phases(mission: Mission) -> list[tuple[str, Node, Node]]:
    """Flow, key and node of every phase."""
    flows = mission.pairs("flows")
    return [(f.value, k, n) for f, node in flows for k, n in mission.pairs("phases", of=node)]


def _run(mission: Mission, phase: Node) -> tuple[Node, str] | None:
    """What the first entry of `run` asks: the node of the state and the group's name."""
    runs = mission.pairs("run", of=phase)
    return (runs[0][1], runs[0][0].value) if runs else None


@dangerous
def given_and_never_given_back(mission: Mission) -> Changes:
    """The flow that was given a vehicle goes round for ever, and the one that gave it waits."""
    for _, key, phase in _phases(mission):
        for way in mission.items("next", of=phase):
            go = mission.at("go", of=way)
            otherwise = mission.at("otherwise", of=phase)
            if go is not None and go.value == "end" and otherwise is not None:
                yield change(put(go, "leave"), put(otherwise, "leave"), also=(key,))


@senseless
def phase_back_to_itself(mission: Mission) -> Changes:
    """`otherwise` leads back to the phase that did not get through: it tries for ever."""
    for _, key, phase in _phases(mission):
        otherwise = mission.at("otherwise", of=phase)
        if otherwise is not None and key.value == "launch":
            yield change(put(otherwise, key.value), also=(key,))


@senseless
def group_without_anybody(mission: Mission) -> Changes:
    """An empty group: `run` asks nobody, `all` is true of nobody."""
    for _, node in mission.pairs("groups"):
        yield change(put(node, "[]"))


@senseless
def group_with_a_stranger(mission: Mission) -> Changes:
    """A vehicle of another mission in the group."""
    for _, node in mission.pairs("groups"):
        yield change(put(node, "[a, b, x]"))


@senseless
def one_of_the_group_forgotten(mission: Mission) -> Changes:
    """A vehicle is left out of `swarm`, so that nobody ever asks it to fly with the others."""
    for key, node in mission.pairs("groups"):
        if key.value == "swarm":
            yield change(put(node, "[a, b, d]"))


@senseless
def barrier_for_a_state_that_nobody_enters(mission: Mission) -> Changes:
    """It waits until all are in a state that this phase never asks for: always `otherwise`."""
    for _, _, phase in _phases(mission):
        run = _run(mission, phase)
        for way in mission.items("next", of=phase):
            when = mission.at("when", of=way)
            if (
                when is not None
                and run
                and "all swarm in hover" in when.value
                and run[1] == "swarm"
            ):
                other = "down" if run[0].value != "down" else "up"
                yield change(put(when, f"all swarm in {other}"), also=(run[0],))


@senseless
def barrier_without_a_way_out(mission: Mission) -> Changes:
    """`within` and `otherwise` are gone: it waits for somebody who may never arrive."""
    for _, key, phase in _phases(mission):
        if mission.at("within", of=phase) and mission.at("otherwise", of=phase):
            edits = drop(mission, phase, "within"), drop(mission, phase, "otherwise")
            merged = edits[0].end > edits[1].start or edits[1].end > edits[0].start > edits[1].start
            if edits[0].end <= edits[1].start or not merged:
                yield change(*edits, also=(key,))


@senseless
def waits_for_the_wrong_flow(mission: Mission) -> Changes:
    """`team.finished` in the flow `team`: it waits for its own end."""
    for flow, key, phase in _phases(mission):
        for way in mission.items("next", of=phase):
            event = mission.at("event", of=way)
            if event is not None and event.value.endswith(".finished"):
                yield change(put(event, f"{flow}.finished"), also=(key,))


@senseless
def asked_while_another_flow_has_it(mission: Mission) -> Changes:
    """A phase asks the whole swarm, while one of it was given to another flow."""
    for _, key, phase in _phases(mission):
        run = mission.at("run", of=phase)
        if mission.at("give", of=phase) is not None and run is not None:
            yield change(put(run.value[0][0], "swarm"), also=(key,))


@senseless
def set_beyond_the_airframe(mission: Mission) -> Changes:
    """A phase sets a speed of 50 m/s, cm/s in mind: it limits nothing any more."""
    for _, _, phase in _phases(mission):
        for _, value in mission.pairs("set", of=phase):
            yield change(put(value, "50 m/s"))


@senseless
def set_to_a_standstill(mission: Mission) -> Changes:
    """A phase sets a speed of 0.5 mm/s: what follows never arrives."""
    for _, _, phase in _phases(mission):
        for _, value in mission.pairs("set", of=phase):
            yield change(put(value, "0.5 mm/s"))


@dangerous
def abort_without_a_landing(mission: Mission) -> Changes:
    """`landing` asks for the turn again, not for the landing."""
    turns = any(state.key.value == "turn" for state in mission.states("circle"))
    for _, key, phase in _phases(mission) if turns else ():
        run = _run(mission, phase)
        if key.value == "landing" and run is not None:
            down = next(s.key for s in mission.states("land"))
            yield change(put(run[0], "turn"), also=(key, down))


def _lab(mission: Mission, one: str, two: str) -> Changes:
    """The first two vehicles on a target `lab` of their own."""
    names = [v.name for v in mission.plan.vehicles]
    if len(names) == 2 and mission.at("targets") is None and mission.at("faults") is None:
        entry = f"lab: {{{names[0]}: {{{one}}}, {names[1]}: {{{two}}}}}"
        yield change(own_section(mission, "targets", entry), target="lab")


MAVLINK = "driver: {use: mavlink, autopilot: px4, address: 'udpin:127.0.0.1:PORT', system: ID}"
VRPN = "sensors: {mocap: {use: vrpn, host: 10.0.0.5, body: BODY}}"


def _wired(port: int, system: int, body: str) -> str:
    own = MAVLINK.replace("PORT", str(port)).replace("ID", str(system))
    return f"{own}, {VRPN.replace('BODY', body)}"


@dangerous
def one_body_for_two(mission: Mission) -> Changes:
    """Both follow the same body of motion capture: each is flown by where the first is."""
    yield from _lab(mission, _wired(14540, 1, "first"), _wired(14541, 2, "first"))


@dangerous
def one_system_for_two(mission: Mission) -> Changes:
    """Both have the address and system id of the first autopilot: it gets the commands of both."""
    yield from _lab(mission, _wired(14540, 1, "first"), _wired(14540, 1, "second"))
