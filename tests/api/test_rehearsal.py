"""A rehearsal finds what can't be proven: each thing in a small mission of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from toolchain import MISSIONS, result_of

from kybflow.api.rehearsal.rehearse import Rehearsal, rehearse
from kybflow.core.errors import EventRefused
from kybflow.core.geometry import add, scale
from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.dsl.diagnostics import Severity
from kybflow.dsl.plan import Plan
from kybflow.flight.motion import IDLE, Motion
from kybflow.parts import AIR, GROUND, Behavior, Entry

HEAD = """\
kybflow: 1
mission: rehearsed
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
"""


class Drift(Behavior[Any], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Flies east for 4 s at 1 m/s, from wherever it is, and tells nobody where."""

    speed = 1.0

    def __init__(self, params: Any, entry: Entry) -> None:
        super().__init__(params, entry)
        self._start, self._heading = entry.position, entry.heading

    def update(self, tick: Tick) -> Setpoint | Done:
        way = (self.speed, 0.0, 0.0)
        place = add(self._start, scale(way, tick.elapsed))
        setpoint = Motion(place, way).setpoint(self._heading)
        return Done(setpoint) if tick.elapsed >= 4.0 else setpoint


class Plunge(Behavior[Any], flight=AIR >> GROUND, emits=SetpointKind.VELOCITY):
    """Comes down too fast."""

    def update(self, tick: Tick) -> Setpoint | Done:
        down = (0.0, 0.0, -2.0 * min(1.0, tick.elapsed / 0.2))
        setpoint = Setpoint(SetpointKind.VELOCITY, None, down)
        return Done(IDLE) if tick.known().position[2] <= 0.0 else setpoint


Change = Callable[[Plan], Plan]


def rehearsed(
    text: str, tmp_path: Path, *changes: Change, head: str = HEAD, **options: Any
) -> Rehearsal:
    result = result_of(tmp_path / "mission.yaml", head + text)
    assert result.plan is not None, result.diagnostics
    plan = result.plan
    for change in changes:
        plan = change(plan)
    return rehearse(plan, texts=result.texts, **options)


def every(**changes: Any) -> Change:
    """Changes fields of every vehicle."""
    return lambda plan: dataclasses.replace(
        plan, vehicles=tuple(dataclasses.replace(v, **changes) for v in plan.vehicles)
    )


BARE, UNHELD = every(supervisors=()), every(processors=())
"""Without supervisors; without processors."""


def replaced(state: str, cls: type[Behavior[Any]]) -> Change:
    """A lab's own behavior in place of that of `state` of the only vehicle."""

    def change(plan: Plan) -> Plan:
        [vehicle] = plan.vehicles
        before = vehicle.states[state]
        part = dataclasses.replace(before.behavior, cls=cls, name=cls.__name__.lower())
        own = dataclasses.replace(before, behavior=part, legs=cls.flight)
        return every(states={**vehicle.states, state: own})(plan)

    return change


DRIFTS = replaced("own", Drift)


def found(rehearsal: Rehearsal) -> list[str]:
    return [d.code for d in rehearsal.diagnostics]


PAIR = """\
vehicles:
  a:
    like: std.nano_plus
    start: {at: [-1, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: over}
      over: {do: fly_to, position: [1, 0, 1], then: down}
      down: {do: land}
  b:
    like: a
    start: {at: [1, 0, 0]}
    behaviors: {over: {position: %s}}
"""
SWAP = PAIR % "[-1, 0, 1]"


ONE = """\
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up:   {do: take_off, height: 1 m, then: over}
      over: {do: fly_to, position: [2.5, 0, 1], then: down}
      down: {do: land}
on:
  - {event: a.took_off, do: [%s]}
"""
IN_FLIGHT = [
    ("{set: {a.processors.limit_speed.speed: 5 cm/s}}", "KYB475", "limit_speed.speed` is 0.05"),
    ("{set: {a.processors.fence.margin: 1 m}}", "KYB473", "fence.margin` is 1.0 by then"),
]


@pytest.mark.parametrize(("action", "code", "said"), IN_FLIGHT)
def test_a_finding_names_what_was_changed_in_flight(
    action: str, code: str, said: str, tmp_path: Path
) -> None:
    [finding] = rehearsed(ONE % action, tmp_path).diagnostics
    assert finding.code == code
    [changed] = finding.related
    assert changed.span.line == len((HEAD + ONE).splitlines())
    assert said in changed.label


def test_what_was_switched_on_again_is_not_named(tmp_path: Path) -> None:
    back = "{disable: a.processors.limit_speed}, {enable: a.processors.limit_speed}"
    [finding] = rehearsed(ONE % back, tmp_path, replaced("over", Drift)).diagnostics
    assert (finding.code, finding.related) == ("KYB473", ())


FORGOTTEN = """\
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up:   {do: take_off, height: 1 m}
      down: {do: land}
  b: {like: a, start: {at: [1, 0, 0]}}
groups: {both: [a, b]}
flows:
  f:
    phases:
      rise: {run: {both: up}, next: [{when: all both in hover, go: fall}], within: 20 s,
             otherwise: fall}
      fall: {run: {%s: down}}
"""


def test_a_vehicle_that_nothing_lands_is_told_with_the_phase_that_forgot_it(tmp_path: Path) -> None:
    [finding] = rehearsed(FORGOTTEN % "a", tmp_path).diagnostics
    assert finding.code == "KYB484"
    assert finding.severity is Severity.WARNING
    assert "`b`" in finding.message
    [flow] = finding.related
    assert flow.span.line == len((HEAD + FORGOTTEN).splitlines())
    assert not rehearsed(FORGOTTEN % "both", tmp_path).diagnostics


def test_two_that_swap_places_on_one_line_are_told_with_both_lines(tmp_path: Path) -> None:
    braked = rehearsed(SWAP, tmp_path)
    [hit] = rehearsed(SWAP, tmp_path, BARE).diagnostics

    assert found(braked) == ["KYB474", "KYB474"]
    first, second = braked.diagnostics
    assert first.message.startswith("the failsafe reacts to `over` of `a` with `brake` at 6.")
    assert (first.span.line, second.span.line) == (12, 17)
    assert first.notes[0].startswith("`b` is in `over` (fly_to) at [0.")
    assert first.notes[0].endswith("mission.yaml:17)")
    assert hit.code == "KYB470"
    assert hit.message.startswith("`a` and `b` collide at 7.")
    assert hit.message.endswith(", 0, 1] m")
    assert hit.span.line == 12
    assert hit.notes[0].endswith("mission.yaml:17)")


def test_two_in_one_landing_place(tmp_path: Path) -> None:
    """The second waits above the first. Where it may choose it turns aside, else it fails."""
    text = (PAIR % "[0.9, 0, 1]").replace(
        "{over: {position: [0.9, 0, 1]}}",
        "{up: {then: wait}, wait: {do: hover, next: [{when: a in landed, go: over}]}, "
        "over: {position: [0.9, 0, 1]}, down: {position: %s}}",
    )
    text = text.replace("at: [1, 0, 0]", "at: [1, 2, 0]")
    aside = rehearsed(text % "null", tmp_path, BARE)
    fails, waits = rehearsed(text % "[0.9, 0, 0]", tmp_path, BARE).diagnostics

    assert found(aside) == ["KYB479"]
    assert aside.is_clean
    assert (waits.code, fails.code) == ("KYB479", "KYB475")
    assert fails.label == "`a` is below for 10 s"
    assert waits.message.startswith("`b` comes down where `a` is, at ")
    assert waits.notes[0].startswith("`a` is in `landed` (wait_on_ground) at [1, 0, 0] m")


ALONE = """\
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: own}
      own:  {do: hover, for_time: 4 s, then: down}
      down: {do: land}
"""


def test_a_labs_own_behavior_that_leaves_the_fence(tmp_path: Path) -> None:
    [held] = rehearsed(ALONE, tmp_path, DRIFTS).diagnostics
    [left] = rehearsed(ALONE, tmp_path, DRIFTS, UNHELD).diagnostics

    assert held.code == left.code == "KYB473"
    assert (held.span.line, left.span.line) == (12, 12)
    assert "`fence` keeps the setpoint" in held.label
    assert "outside the fence" in left.label
    assert "`own` (drift) leads `a` out of bounds at " in left.message


class Breaks(Behavior[Any], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Raises."""

    def update(self, tick: Tick) -> Setpoint:
        raise ZeroDivisionError


def test_a_part_that_raises(tmp_path: Path) -> None:
    [one] = rehearsed(ALONE, tmp_path, replaced("own", Breaks)).diagnostics

    assert one.code == "KYB475"
    assert "`behaviors.own` failed: ZeroDivisionError" in one.label


def test_a_touch_down_that_is_too_fast(tmp_path: Path) -> None:
    one = rehearsed(ALONE, tmp_path, BARE, UNHELD, replaced("down", Plunge))

    assert found(one) == ["KYB472"]
    assert one.diagnostics[0].message.startswith("`a` touches down with 2.00 m/s at ")
    assert one.diagnostics[0].span.line == 13


def test_two_that_pass_too_close(tmp_path: Path) -> None:
    text = (PAIR % "[-1, 0.22, 1]").replace("at: [1, 0, 0]", "at: [1, 0.22, 0]")
    one = rehearsed(text, tmp_path, BARE)

    assert found(one) == ["KYB480"]
    assert one.is_clean
    assert one.separation is not None
    assert one.separation.metres == pytest.approx(0.22, abs=0.005)
    assert one.separation.pair == ("a", "b")


def test_a_preflight_that_stays_red(tmp_path: Path) -> None:
    one = rehearsed(ALONE, tmp_path, every(start=(5.0, 0.0, 0.0)))

    assert found(one) == ["KYB481"]
    assert one.diagnostics[0].label == "2.00 m outside"


def test_a_path_through_an_obstacle_from_a_place_known_only_in_flight(tmp_path: Path) -> None:
    pillar = "pillar: {cylinder: {at: [2, 0, 0], radius: 20 cm, height: 2.5 m}}"
    head = f"{HEAD}  obstacles: {{{pillar}}}\n"
    [held] = rehearsed(ALONE, tmp_path, DRIFTS, head=head).diagnostics
    through = rehearsed(ALONE, tmp_path, DRIFTS, UNHELD, head=head)
    [hit] = [d for d in through.diagnostics if d.code == "KYB471"]

    assert held.code == "KYB473"
    assert "`obstacle_guard` keeps the setpoint" in held.label
    assert hit.message.startswith("`a` runs into `pillar` at ")


def test_an_obstacle_that_moves_into_a_vehicle(tmp_path: Path) -> None:
    ball = "{along: [[2, 0, 1], [-2, 0, 1]], radius: 15 cm, speed: 30 cm/s}"
    head = f"{HEAD}  obstacles: {{ball: {{moving_sphere: {ball}}}}}\n"
    one = rehearsed(ALONE, tmp_path, UNHELD, head=head)
    [hit] = [d for d in one.diagnostics if d.code == "KYB471"]

    assert hit.message.startswith("`a` runs into `ball` at ")


STALL = """\
time_limit: 40 s
vehicles:
  a:
    like: std.nano_plus
    start: {at: [-1, 0, 0]}
    begin: wait
    behaviors:
      wait: {do: wait_on_ground, next: [{when: b in hover, go: up}]}
      up:   {do: take_off, height: 1 m, then: down}
      down: {do: land}
  b: {like: a, start: {at: [1, 0, 0]}, behaviors: {wait: {next: [{when: a in hover, go: up}]}}}
"""


def test_vehicles_that_wait_for_each_other(tmp_path: Path) -> None:
    [one] = rehearsed(STALL, tmp_path).diagnostics

    assert one.code == "KYB477"
    assert one.message == "the mission is not over after 40 s: `a` is still in `wait`"
    assert one.label == "waits for `b in hover`"
    assert "`b` is in `wait` (wait_on_ground)" in one.notes[1]


FLOW = """\
time_limit: 60 s
hover_limit: 90 s
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: hover}
      down: {do: land}
flows:
  team:
    begin: rise
    phases:
      rise: {run: {a: up}, next: [{%s, go: fall}]%s}
      fall: {run: {a: down}}
"""


def test_a_flow_that_stalls(tmp_path: Path) -> None:
    text = FLOW % ("when: a.state.altitude > 1.2 m", ", within: 50 s, otherwise: fall")
    [one] = rehearsed(text, tmp_path).diagnostics

    assert one.code == "KYB476"
    assert one.message.startswith("the phase `rise` of `team` is not over within its time of 50 s")
    assert one.severity is Severity.ERROR


FORMED = """\
groups: {pair: [a, b]}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: hover}
      fly:  {do: formation, members: pair, %s, then: hover, failed: down}
      down: {do: land}
  b: {like: a, start: {at: [0, 1, 0]}}
flows:
  plan:
    phases:
      rise: {run: {pair: up}, next: [{when: all pair in hover, go: fly}], within: 20 s,
             otherwise: land}
      fly:  {run: {pair: fly}, next: [{when: all pair in hover, go: land}], within: 30 s,
             otherwise: land}
      land: {run: {pair: down}}
"""


def test_a_formation_without_room_says_what_it_waits_for(tmp_path: Path) -> None:
    [one] = rehearsed(FORMED % "path: [[0, 2.6, 1]]", tmp_path).diagnostics

    assert one.code == "KYB476"
    assert all("waits for room: a place is at the fence" in note for note in one.notes)


def test_members_that_come_too_close_are_not_told_to_come_in_turns(tmp_path: Path) -> None:
    diagnostics = rehearsed(FORMED % "side: 30 cm, path: [[1, 0.5, 1]]", tmp_path).diagnostics
    hints = {d.help for d in diagnostics if d.code == "KYB474"}

    assert hints == {"keep their paths apart, in height or in time, or move the bound"}


def test_a_persons_events_come_two_seconds_after_they_are_waited_for(tmp_path: Path) -> None:
    text = FLOW % ("event: operator.go", "")

    one = rehearsed(text, tmp_path)
    later = rehearsed(text, tmp_path, emitted=((20.0, "operator.go"),))

    assert found(one) == found(later) == []
    [assumed] = one.assumed
    assert assumed.name == "operator.go"
    assert assumed.waiting == "`rise` of `team`"
    assert 6.0 < assumed.seconds < 8.0
    assert later.assumed == ()
    assert later.duration > 20.0
    with pytest.raises(EventRefused):
        rehearsed(text, tmp_path, emitted=((1.0, "operator.goo"),))


def test_a_battery_that_ends_before(tmp_path: Path) -> None:
    text = ALONE.replace("for_time: 4 s", "for_time: 60 s")

    def weak(plan: Plan) -> Plan:
        airframe = dataclasses.replace(plan.vehicles[0].airframe, endurance=40.0)
        return every(airframe=airframe)(plan)

    empty = rehearsed(text, tmp_path, weak, BARE)
    acted = rehearsed(text, tmp_path, weak)

    assert found(empty) == ["KYB478"]
    assert empty.charge is not None
    assert empty.charge.remaining == 0.0
    assert found(acted) == ["KYB474"]
    assert acted.diagnostics[0].span.line == 12


def test_a_behavior_that_fails_or_takes_too_long(tmp_path: Path) -> None:
    text = ALONE.replace("then: own}", "then: own, within: 4.7 s}")
    once = ALONE.replace("{do: hover, for_time: 4 s", "{do: release_payload").replace(
        "at: [0, 0, 0]}", "at: [0, 0, 0]}\n    payload: {mass: 10 g, size: 3 cm, aboard: false}"
    )
    [late] = rehearsed(text, tmp_path).diagnostics
    [fails] = rehearsed(once, tmp_path).diagnostics

    assert late.code == "KYB476"
    assert late.message.startswith("`up` of `a` is not done within its limit of 4.7 s, at 4.8 s")
    assert fails.code == "KYB475"
    assert fails.message.startswith("`own` (release_payload) of `a` fails at ")
    assert fails.label == "no payload is on board"


def test_what_an_input_at_rest_steers_goes_on(tmp_path: Path) -> None:
    result = result_of(MISSIONS / "joystick.yaml", target="hands")
    assert result.plan is not None
    one = rehearse(result.plan, texts=result.texts)

    assert found(one) == []
    assert [a.name for a in one.assumed] == [
        "stick.take", "stick.give", "stick.take", "stick.land"
    ]  # fmt: skip


def test_one_that_starts_on_an_obstacle_lands_there(tmp_path: Path) -> None:
    head = f"{HEAD}  obstacles: {{table: {{box: {{from: [-1, -1, 0], to: [1, 1, 0.5]}}}}}}\n"
    raised = ALONE.replace("at: [0, 0, 0]", "at: [0, 0, 0.5]")

    assert found(rehearsed(raised, tmp_path, head=head)) == []


def test_an_expectation_that_ideal_vehicles_do_not_meet(tmp_path: Path) -> None:
    """Where faults are left out, what the mission expects may be about them."""
    expects = "expect: [finally distance(a to a.start) > 1 m, finally a in landed]\n"
    fault = "faults: [{at: 2 s, on: a, inject: gust, velocity: [1, 0, 0], for: 1 s}]\n"

    [unmet] = rehearsed(ALONE + expects, tmp_path).diagnostics

    assert unmet.code == "KYB482"
    assert unmet.message == "`finally distance(a to a.start) > 1 m` does not hold on ideal vehicles"
    assert unmet.label == "it is 0 cm"
    assert found(rehearsed(ALONE + expects + fault, tmp_path)) == []


def test_a_fault_explains_only_what_it_can_change(tmp_path: Path) -> None:
    """What has failed before the fault, what is about another vehicle, and a place that is far from
    the whole flight."""
    fault = "faults: [{at: 4 s, on: a, inject: gust, velocity: [1, 0, 0], for: 1 s}]\n"
    before = "  - always a.state.altitude < 50 cm\n"
    far = "  - finally distance(a to [2.5 2 0]) < 10 cm\n"
    near = "  - finally distance(a to [0.5 0 0]) < 10 cm\n"
    explained = "  - always a.state.speed < 1 cm/s\n"
    beside = "  b: {like: a, start: {at: [2, 0, 0]}}\n"
    another = "  - finally distance(b to [1.5 0 0]) < 10 cm\n"

    one = rehearsed(f"{ALONE}{fault}expect:\n{before}{far}{near}", tmp_path)
    two = rehearsed(f"{ALONE}{beside}{fault}expect:\n{near}{another}", tmp_path)
    late = fault.replace("4 s", "0.1 s")

    assert [d.message.split("`")[1] for d in one.diagnostics] == [before[4:-1], far[4:-1]]
    assert [d.message.split("`")[1] for d in two.diagnostics] == [another[4:-1]]
    assert found(rehearsed(f"{ALONE}{late}expect:\n{explained}", tmp_path)) == []


def test_a_fault_that_comes_after_the_flight_or_never(tmp_path: Path) -> None:
    gust = "on: a, inject: gust, velocity: [1, 0, 0], for: 1 s"
    late = rehearsed(f"{ALONE}faults: [{{at: 2 min, {gust}}}]\n", tmp_path)
    never = "when: behavior == own and elapsed > 5 s"
    measured = "when: behavior == own and state.speed > 10 cm/s"

    assert found(late) == ["KYB483"]
    assert late.diagnostics[0].message == "`gust` begins after the flight of `a`"
    assert found(rehearsed(f"{ALONE}faults: [{{{never}, {gust}}}]\n", tmp_path)) == ["KYB483"]
    assert found(rehearsed(f"{ALONE}faults: [{{{measured}, {gust}}}]\n", tmp_path)) == []


def test_a_watch_that_fails_is_no_clean_rehearsal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def raises(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("kybflow.api.rehearsal.watch.Watch.on_tick", raises)

    with pytest.raises(RuntimeError, match="could not be watched: ZeroDivisionError"):
        rehearsed(ALONE, tmp_path)


def test_it_repeats_exactly(tmp_path: Path) -> None:
    assert rehearsed(SWAP, tmp_path) == rehearsed(SWAP, tmp_path)
