"""The engine, with plans built without YAML: order, failures, failsafe, nobody else disturbed."""

from __future__ import annotations

import json
import signal
from dataclasses import replace
from math import cos, nan, sin
from types import SimpleNamespace

import pytest
from plans import bent, part, state, then, vehicle
from short_flights import NoParams, Still, down, hold, named, path, up

from kybflow.api.flight import is_in_air
from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Failed, Setpoint, SetpointKind, Tick, Truth
from kybflow.core.text import headline
from kybflow.drivers.sim import Sim
from kybflow.dsl.expressions import Finally, Finished, InState
from kybflow.dsl.plan import EstimatorPlan, ExpectationPlan, TransitionPlan
from kybflow.parts import AIR, Entry
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import Airframe, VehicleContext


class Exploding(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def update(self, tick: Tick) -> Setpoint:
        if tick.elapsed > 1.0:
            raise ZeroDivisionError("a lab's own bug")
        return self.setpoint


class NotFinite(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def update(self, tick: Tick) -> Setpoint:
        return self.setpoint._replace(position=(nan, 0.0, 1.0))


class Refusing(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: NoParams, entry: Entry) -> None:
        raise Refused("the door is shut")


class Failing(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def update(self, tick: Tick) -> Failed:
        return Failed(self.setpoint, "no way through")


class Jumping(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    """Asks for a place one metre away at once."""

    def update(self, tick: Tick) -> Setpoint:
        x, y, z = self.setpoint.position or (0.0, 0.0, 1.0)
        return self.setpoint._replace(position=(x + 1.0, y, z))


def test_a_flight_goes_through_its_states_and_ends_on_the_ground(run):
    flown, told = run(vehicle("a", [up("hold"), hold(1.0, "down"), down()]))
    assert flown.exit_code == 0
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert [e.name for e in told if e.name in ("took_off", "landed")] == ["took_off", "landed"]
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_the_same_plan_and_seed_give_the_same_bytes_and_another_seed_others(run):
    def a():
        return vehicle("a", [up("down"), down()])

    first, second, other = (run(a(), seed=s)[0].folder for s in (3, 3, 4))
    log = "log.mcap"
    assert (first / log).read_bytes() == (second / log).read_bytes()
    assert (first / "events.jsonl").read_bytes() == (second / "events.jsonl").read_bytes()
    assert (first / log).read_bytes() != (other / log).read_bytes()


def test_the_time_of_a_mission_counts_from_the_end_of_its_preflight(run):
    expected = ExpectationPlan("finished within 60 s", Finished(60.0), "m.yaml:1")
    flown, _ = run(vehicle("a", [up("down"), down()]), expectations=(expected,))
    [verdict] = flown.summary["expectations"]
    begun = flown.summary["vehicles"]["a"]["behaviors"][0]["start_s"]
    assert begun > 0.0
    assert verdict["value"] == pytest.approx(flown.summary["sim_time_s"] - begun, abs=0.01)


def test_a_part_that_raises_lands_its_vehicle_and_no_other(run):
    good = [up("hold"), hold(2.0, "down"), down()]
    calm, _ = run(vehicle("a", good, start=(-1.0, 0.0, 0.0)), vehicle("b", [up("down"), down()]))
    bad = [up("boom"), state("boom", Exploding, then("down")), down()]
    flown, told = run(vehicle("a", good, start=(-1.0, 0.0, 0.0)), vehicle("b", bad))
    assert path(told, "b") == ["up", "boom", "auto_land", "fault"]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    [failed] = named(told, "part_failed")
    assert failed.fields["part"] == "behaviors.boom"
    assert failed.fields["reason"] == "ZeroDivisionError: a lab's own bug"
    assert "Traceback" in str(failed.fields["traceback"])
    assert flown.exit_code == 1
    assert "b ended in `fault`" in flown.summary["reason"]
    errors = [f.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"] for f in (calm, flown)]
    assert errors[0] == errors[1]


def test_a_setpoint_that_is_not_finite_is_a_failure_in_the_same_tick(run):
    states = [up("nan"), state("nan", NotFinite, then("down")), down()]
    flown, told = run(vehicle("a", states))
    began = next(e.time for e in told if e.fields.get("behavior") == "nan")
    [failed] = named(told, "part_failed")
    assert failed.time == began
    assert path(told, "a")[-1] == "fault"
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_a_behavior_that_refuses_to_start_goes_where_its_failed_says(run):
    shut = state("shut", Refusing, then("down"), TransitionPlan(target="down", cause="failed"))
    _, told = run(vehicle("a", [up("shut"), shut, down()]))
    assert path(told, "a") == ["up", "shut", "down", "landed"]
    [failed] = named(told, "behavior_failed")
    assert failed.fields == {"behavior": "shut", "reason": "the door is shut"}


def test_without_a_failed_arrow_a_refusal_brakes_hovers_and_lands(run):
    shut = state("shut", Refusing, then("down"))
    flown, told = run(vehicle("a", [up("shut"), shut, down()], hover_limit=1.0))
    assert path(told, "a") == ["up", "shut", "brake", "hover", "auto_land", "landed"]
    assert flown.exit_code == 1
    assert "a: `shut` failed: the door is shut" in flown.summary["reason"]


def test_a_behavior_that_fails_goes_where_its_failed_says(run):
    failing = state("try", Failing, then("hold"), TransitionPlan(target="down", cause="failed"))
    flown, told = run(vehicle("a", [up("try"), failing, hold(9.0, "down"), down()]))
    assert path(told, "a") == ["up", "try", "down", "landed"]
    assert named(told, "behavior_failed")[0].fields["reason"] == "no way through"
    assert flown.exit_code == 0


def test_within_ends_a_state_that_takes_too_long(run):
    still = state(
        "still", Still, then("hold"), TransitionPlan(target="down", cause="within", after=2.0)
    )
    flown, told = run(vehicle("a", [up("still"), still, hold(9.0, "down"), down()]))
    assert path(told, "a") == ["up", "still", "down", "landed"]
    visit = flown.summary["vehicles"]["a"]["behaviors"][1]
    assert visit["ended"] == "within"
    assert visit["end_s"] - visit["start_s"] == pytest.approx(2.0, abs=1e-3)


def test_a_setpoint_that_jumps_away_brakes_and_is_then_flown_to(run):
    jump = state("jump", Jumping, then("down"), TransitionPlan(target="down", after=1.0))
    flown, told = run(vehicle("a", [up("jump"), jump, down()]))
    assert path(told, "a") == ["up", "jump", "down", "landed"]
    assert named(told, "position_error_exceeded")[0].fields["value"] == pytest.approx(1.0, abs=0.1)
    [started], [ended] = named(told, "failsafe_started"), named(told, "failsafe_ended")
    assert ended.time - started.time == pytest.approx(NS, abs=NS // 100)
    assert flown.exit_code == 0


def test_an_empty_battery_lands_and_latches(run):
    driver = part("drivers", "sim", battery=0.2)
    frame = vehicle("x", [down()]).airframe
    weak = type(frame)(**{**vars(frame), "endurance": 120.0})
    states = [up("hold"), hold(20.0, "down"), down()]
    flown, told = run(vehicle("a", states, driver=driver, airframe=weak))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert named(told, "failsafe_started")[0].fields["reaction"] == "land"
    assert flown.exit_code == 1


def deaf(since=0.0):
    """The simulator, from which nothing arrives from `since` seconds on."""
    return bent(lambda measurement, now: measurement if now < since * NS else None)


@pytest.mark.thorough
def test_a_lost_estimate_lands_blind_from_two_metres(run):
    states = [up("hold", height=1.5), hold(20.0, "down"), down()]
    flown, told = run(vehicle("a", states, driver=deaf(8.0)))
    assert path(told, "a") == ["up", "hold", "land_blind", "fault"]
    [started] = named(told, "failsafe_started")
    assert started.fields["reaction"] == "land_blind"
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_an_interrupt_lands_and_leaves_a_whole_record(run):
    def interrupt(engine):
        if engine.seconds() > 5.0 and not engine.interrupts:
            signal.raise_signal(signal.SIGINT)

    states = [up("hold"), hold(60.0, "down"), down()]
    flown, told = run(vehicle("a", states), observers=(interrupt,))
    assert flown.exit_code == 130
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert json.loads((flown.folder / "summary.json").read_text())["outcome"] == "interrupted"


def test_at_the_time_limit_a_run_that_hangs_in_the_air_lands(run):
    flown, told = run(vehicle("a", [up("still"), state("still", Still)]), time_limit=6.0)
    assert flown.exit_code == 1
    assert "time limit of 6 s" in flown.summary["reason"]
    assert path(told, "a") == ["up", "still", "auto_land", "fault"]
    assert flown.summary["vehicles"]["a"]["final"] == "ground"
    assert flown.summary["sim_time_s"] < 12.0


def test_an_interrupt_in_the_preflight_ends_the_run_there(run):
    def interrupt(engine):
        if not engine.interrupts:
            signal.raise_signal(signal.SIGTERM)

    flown, told = run(vehicle("a", [up("down"), down()]), observers=(interrupt,))
    assert flown.exit_code == 130
    assert named(told, "behavior_started") == []


def test_preflight_keeps_a_vehicle_without_poses_on_the_ground(run):
    flown, told = run(vehicle("a", [up("down"), down()], driver=deaf()))
    assert named(told, "behavior_started") == []
    assert flown.exit_code == 1
    reason = flown.summary["reason"]
    assert "a: estimate: no healthy estimate from mocap" in reason
    first, *others = named(told, "preflight_failed")
    words = f"preflight: a: {first.fields['check']}: {first.fields['reason']}"
    assert headline(reason) == f"{words}, and {len(others)} more red lines"


def test_after_a_failed_preflight_no_vehicle_is_in_a_state(run):
    landed = ExpectationPlan("finally a in landed", Finally(InState("a", "landed")), "m.yaml:9")
    flown, _ = run(vehicle("a", [up("down"), down()], driver=deaf()), expectations=(landed,))
    assert [e["held"] for e in flown.summary["expectations"]] == [False]


class Clinging(Sim):
    """What it opens can't be closed."""

    @classmethod
    def open(cls, seats, generator):
        session = super().open(seats, generator)

        def close():
            raise OSError("the port is gone")

        session.close = close
        return session


def test_what_cannot_be_closed_is_told_in_the_summary(run):
    driver = replace(part("drivers", "sim"), cls=Clinging)
    flown, told = run(vehicle("a", [up("down"), down()], driver=driver))
    assert flown.exit_code == 3
    assert "can't be closed: OSError: the port is gone" in flown.summary["reason"]
    assert named(told, "run_ended") != []


FRAME = Airframe(
    mass=0.23, diameter=0.19, inertia=(0.00045, 0.00045, 0.0008), thrust=1.3, rotor_time=0.03
)
TABLE = Box((2.0, -1.0, 0.0), (3.0, 1.0, 0.7))


def resting(position: Vec3, tilt: float = 0.0, speed: float = 0.0) -> SimpleNamespace:
    """A vehicle that believes itself on the ground, and where it is in truth."""
    attitude = (cos(0.5 * tilt), sin(0.5 * tilt), 0.0, 0.0)
    context = VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004, obstacles={"table": TABLE})
    return SimpleNamespace(
        truth=Truth(position, (0.0, 0.0, speed), attitude, ZERO),
        context=context,
        runner=SimpleNamespace(off_ground=False),
    )


@pytest.mark.parametrize(
    ("vehicle", "mistaken"),
    [
        (resting((0.0, 0.0, 0.0)), False),
        (resting((0.0, 0.0, -0.2)), False),
        (resting((0.0, 0.0, 0.09), tilt=1.5), False),
        (resting((0.0, 0.0, 0.14)), True),
        (resting((0.0, 0.0, 7.9), speed=0.02), True),
        (resting((2.5, 0.0, 0.75)), False),
        (resting((2.5, 0.0, 0.9)), True),
        (resting((1.5, 0.0, 0.75)), True),
    ],
)
def test_who_believes_itself_on_the_ground_may_be_in_the_air(vehicle, mistaken):
    assert is_in_air(vehicle, ()) is mistaken


def test_who_lies_on_another_vehicle_is_not_in_the_air():
    above, below = resting((0.0, 0.05, 0.05)), resting((0.0, 0.0, 0.0))
    assert is_in_air(resting((0.0, 0.05, 0.08)), ())
    assert not is_in_air(above, [above, below])


def test_preflight_keeps_a_vehicle_on_the_ground_that_would_land_at_once(run):
    empty = part("drivers", "sim", battery=0.1)
    flown, told = run(vehicle("a", [up("down"), down()], driver=empty))
    assert named(told, "behavior_started") == []
    assert flown.exit_code == 1
    assert "a: supervisors.battery: 10% left, below 15%" in flown.summary["reason"]


def test_options_of_the_command_line_reach_the_part_and_the_record(run):
    options = (("a.processors.position_error.limit", "20 cm"),)
    jump = state("jump", Jumping, then("down"))
    _, told = run(
        vehicle("a", [up("jump"), jump, down()], hover_limit=1.0), options=options, time_limit=9.0
    )
    assert named(told, "option_changed")[0].fields["by"] == "command line"
    # soon after lift-off the limit is 1.6 times as large
    assert named(told, "position_error_exceeded")[0].fields["bound"] == pytest.approx(0.32)


@pytest.mark.thorough
def test_an_option_reaches_a_living_estimator(run):
    parts = []

    class Kept(part("estimators", "mocap").cls):
        def __init__(self, params, context):
            super().__init__(params, context)
            parts.append(self)

    estimator = EstimatorPlan(replace(part("estimators", "mocap"), cls=Kept), recover_after=1.0)
    options = (("a.estimators.mocap.gap", "200 ms"),)
    run(vehicle("a", [up("down"), down()], estimators=(estimator,)), options=options)
    assert parts[0].params.gap == pytest.approx(0.2)
