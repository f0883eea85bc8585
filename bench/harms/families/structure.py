"""State machines that never end, never begin, or have ways that are never taken."""

from __future__ import annotations

from harms.families.physics import way_out
from harms.mission_text import Mission, Node, State, add, add_last, drop, put
from harms.operator import Changes, change, dangerous, senseless


def _linked(mission: Mission) -> list[tuple[State, Node]]:
    """The states in the air that `then` leads out of, and where to."""
    found = []
    for state in mission.flying():
        target = mission.at("then", of=state.node)
        if target is not None and target.value in _names(mission, state.vehicle):
            found.append((state, target))
    return found


def _names(mission: Mission, vehicle: str) -> list[str]:
    return [s.name for s in mission.states() if s.vehicle == vehicle]


def _key(mission: Mission, vehicle: str, state: str) -> Node | None:
    keys = (s.key for s in mission.states() if (s.vehicle, s.name) == (vehicle, state))
    return next(keys, None)


@dangerous
def then_left_out(mission: Mission) -> Changes:
    """Nothing follows a state in the air: it brakes and hovers until the limit lands it."""
    for state, target in _linked(mission):
        also = (state.key, _key(mission, state.vehicle, target.value))
        yield change(drop(mission, state.node, "then"), also=also)


@dangerous
def then_to_itself(mission: Mission) -> Changes:
    """`hold` leads to `hold`: it flies that until the battery ends."""
    for state, target in _linked(mission):
        lost = _key(mission, state.vehicle, target.value)
        yield change(put(target, state.name), also=(state.key, lost))


@dangerous
def back_and_forth(mission: Mission) -> Changes:
    """The last state in the air leads back to one before it: round and round, never down."""
    for state, target in _linked(mission):
        if target.value == mission.landing(state.vehicle):
            first = next(s for s, _ in _linked(mission) if s.vehicle == state.vehicle)
            if first.name != state.name:
                lost = _key(mission, state.vehicle, target.value)
                yield change(put(target, first.name), also=(state.key, lost))


@dangerous
def led_to_what_never_ends(mission: Mission) -> Changes:
    """`then` leads to a hover of one's own that has no end and no way out."""
    for state, target in _linked(mission):
        behaviors = mission.at("vehicles", state.vehicle, "behaviors")
        if behaviors is not None and behaviors.value:
            edits = put(target, "stay"), add_last(behaviors, "stay: {do: hover}")
            moved = _key(mission, state.vehicle, target.value)
            yield change(*edits, also=(state.key, moved))


@dangerous
def hover_without_its_time(mission: Mission) -> Changes:
    """`for_time` is gone: this hover never ends, and `then` is never taken."""
    for state in mission.states("hover"):
        if mission.at("for_time", of=state.node) and not mission.at("next", of=state.node):
            edit = drop(mission, state.node, "for_time")
            yield change(edit, also=(mission.at("then", of=state.node),))


@dangerous
def circle_without_laps(mission: Mission) -> Changes:
    """`laps` is gone: this circle never ends, and `then` is never taken."""
    for state in mission.states("circle"):
        if mission.at("laps", of=state.node):
            edit = drop(mission, state.node, "laps")
            yield change(edit, also=(mission.at("then", of=state.node),))


@dangerous
def landing_forgotten(mission: Mission) -> Changes:
    """No state lands: what was the way down and the state itself are both gone."""
    for state, target in _linked(mission):
        users = [s for s, t in _linked(mission) if t.value == target.value]
        landing = next((s for s in mission.states("land") if s.name == target.value), None)
        if landing is None or len(users) != 1 or landing.vehicle != state.vehicle:
            continue
        behaviors = mission.at("vehicles", state.vehicle, "behaviors")
        others = mission.text.count(f"go: {landing.name}") + mission.text.count(
            f"failed: {landing.name}"
        )
        if behaviors is not None and not others and mission.at("flows") is None:
            edits = drop(mission, state.node, "then"), drop(mission, behaviors, landing.name)
            yield change(*edits, also=(state.key,))


@senseless
def second_way_behind_the_first(mission: Mission) -> Changes:
    """`elapsed > 1 s` before `elapsed > 2 s`: the second way is never taken."""
    for state in mission.flying("hover", "circle", "follow_path", "figure_eight"):
        ways = mission.at("next", of=state.node)
        target = mission.word("then", of=state.node)
        if ways is None and target:
            go = mission.landing(state.vehicle)
            both = f"{{when: elapsed > 1 s, go: {target}}}, {{when: elapsed > 2 s, go: {go}}}"
            yield change(add(state.node, f"next: [{both}]"))


@senseless
def same_way_twice(mission: Mission) -> Changes:
    """Two ways on one condition to two states: the second is never taken."""
    for state in mission.flying("hover", "circle", "follow_path", "figure_eight"):
        ways = mission.at("next", of=state.node)
        target = mission.word("then", of=state.node)
        if ways is None and target:
            low = "when: battery.remaining < 40 %"
            both = f"{{{low}, go: {mission.landing(state.vehicle)}}}, {{{low}, go: {target}}}"
            yield change(add(state.node, f"next: [{both}]"))


@senseless
def event_that_nobody_tells(mission: Mission) -> Changes:
    """`event: reached`: no part and no callback tells it."""
    for state in mission.flying():
        yield change(way_out(mission, state, "event: reached"))


@senseless
def event_of_a_stranger(mission: Mission) -> Changes:
    """`drone2.landed`, from another mission: no such vehicle is here."""
    for state in mission.flying():
        yield change(way_out(mission, state, "event: drone2.landed"))


@senseless
def in_another_state_than_its_own(mission: Mission) -> Changes:
    """In `hold`, it waits until it is in `down`: it is in one state at a time."""
    for state in mission.flying():
        cause = f"when: {state.vehicle} in {mission.landing(state.vehicle)}"
        if state.name != mission.landing(state.vehicle) and not mission.at("flows"):
            yield change(way_out(mission, state, cause))


@senseless
def in_its_own_state(mission: Mission) -> Changes:
    """In `hold`, it goes on when it is in `hold`: at once."""
    for state in mission.flying():
        yield change(way_out(mission, state, f"when: {state.vehicle} in {state.name}"))


@senseless
def left_at_once(mission: Mission) -> Changes:
    """`after: 0 s`: the state is left before it has done anything."""
    for state in mission.flying():
        yield change(way_out(mission, state, "after: 0 s"))


@senseless
def waits_for_its_own_landing(mission: Mission) -> Changes:
    """In the air, it waits for its own event `landed`: it can't come before it lands."""
    for state in mission.flying():
        yield change(way_out(mission, state, "event: landed"))


@dangerous
def begins_in_the_air(mission: Mission) -> Changes:
    """`begin` names a hover: the run begins on the ground."""
    for vehicle in mission.own():
        states = [s for s in mission.flying("hover") if s.vehicle == vehicle.name]
        if states and mission.at("begin", of=vehicle.node) is None:
            yield change(add(vehicle.node, f"begin: {states[0].name}"))


@dangerous
def landed_while_it_flies(mission: Mission) -> Changes:
    """`then: landed` out of a state in the air, in place of a state that lands."""
    for state, target in _linked(mission):
        yield change(put(target, "landed"), also=(state.key,))


@dangerous
def takes_off_in_the_air(mission: Mission) -> Changes:
    """A state in the air leads to the take-off, which begins on the ground."""
    ups = {s.vehicle: s.name for s in mission.states("take_off")}
    for state, target in _linked(mission):
        if state.vehicle in ups:
            yield change(put(target, ups[state.vehicle]), also=(state.key,))


@dangerous
def failed_back_into_itself(mission: Mission) -> Changes:
    """`failed` leads to the state that has failed: it fails again and again, in the air."""
    for state in mission.flying("fly_to", "follow_path", "steer"):
        own = mission.at("failed", of=state.node)
        text = f"failed: {state.name}"
        yield change(put(own, state.name) if own else add(state.node, text), also=(state.key,))


@senseless
def payload_that_it_does_not_carry(mission: Mission) -> Changes:
    """`release_payload` on a vehicle that carries nothing."""
    for state, target in _linked(mission):
        if mission.planned(state.vehicle).payload is None:
            behaviors = mission.at("vehicles", state.vehicle, "behaviors")
            drop_it = f"let_go: {{do: release_payload, then: {target.value}}}"
            if behaviors is not None and behaviors.value:
                yield change(put(target, "let_go"), add_last(behaviors, drop_it), also=(state.key,))


@senseless
def state_that_nothing_leads_to(mission: Mission) -> Changes:
    """A state was written, and the link to it forgotten."""
    for vehicle in mission.own():
        behaviors = mission.at("behaviors", of=vehicle.node)
        down = mission.landing(vehicle.name)
        if behaviors is not None and down and behaviors.value:
            entry = f"look: {{do: hover, for_time: 2 s, then: {down}}}"
            yield change(add_last(behaviors, entry))
