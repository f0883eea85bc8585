"""The figures of a run, its outcome and its summary."""

from __future__ import annotations

import json

import pytest
from recorded_run import make_plan

from kybflow.core.errors import INVALID
from kybflow.recording.outcome import EXIT_CODES, Ending, decide, measured, summarise
from kybflow.runtime.expectations import Verdict
from kybflow.runtime.scores import Score

HELD = Verdict("finished within 60 s", True, 41.25, 18.75, "s", "m.yaml:31")
UNMET = "`max(mk.position_error) < 1 cm`: 3.12 cm, off by 2.12 cm  [m.yaml:32]"
NEVER = Verdict("eventually mk in landed", False, None, None, "s", "m.yaml:33")
BROKEN = Verdict("max(mk.position_error) < 1 cm", False, 0.0312, -0.0212, "m", "m.yaml:32")


def flown_score() -> Score:
    score = Score(make_plan("mk"))
    mk = score.vehicle("mk")
    mk.estimator("mocap", 0.0)
    mk.entered("up", "take_off", 0.5)
    mk.in_air(True, 0.75)
    mk.in_air(False, 3.5)
    mk.in_air(True, 4.25)
    mk.position.add(0.03)
    mk.velocity.add(0.3)
    mk.position.add(0.04)
    mk.left("done", 3.125)
    mk.entered("wait", "hover", 3.125)
    mk.left("next", 4.0)
    mk.entered("up", "take_off", 4.0)
    mk.position.add(0.0)
    mk.velocity.add(0.1)
    mk.battery(0.95)
    mk.battery(0.93)
    mk.battery(0.94)
    mk.clearance(0.25)
    mk.clearance(0.5)
    return score


def figures(mean, rms, most):
    return {"mean": mean, "rms": rms, "max": most}


def behavior(name, part, start, end, ended, position=None, velocity=None):
    visit = {"name": name, "part": part, "start_s": start, "end_s": end, "ended": ended}
    return {**visit, "position_error_m": position, "velocity_error_m_s": velocity}


def test_the_summary_has_the_documented_shape():
    summary = summarise(
        make_plan("mk"),
        flown_score(),
        [HELD],
        Ending(),
        seed=7,
        sim_time_s=41.2,
        wall_time_s=0.8,
        missed_ticks=3,
    )
    up, up_again = figures(0.035, 0.0353553, 0.04), figures(0.0, 0.0, 0.0)
    behaviors = [
        behavior("up", "take_off", 0.5, 3.125, "done", up, figures(0.3, 0.3, 0.3)),
        behavior("wait", "hover", 3.125, 4.0, "next"),
        behavior("up", "take_off", 4.0, None, None, up_again, figures(0.1, 0.1, 0.1)),
    ]
    assert summary == {
        "kybflow": 1,
        "mission": "figure_eight",
        "outcome": "succeeded",
        "reason": None,
        "seed": 7,
        "target": "sim",
        "world": "a lab",
        "sim_time_s": 41.2,
        "wall_time_s": 0.8,
        "real_time_factor": 51.5,
        "missed_ticks": 3,
        "vehicles": {
            "mk": {
                "final": "ground",
                "airborne_s": [[0.75, 3.5], [4.25, None]],
                "position_error_m": figures(0.0233333, 0.0288675, 0.04),
                "velocity_error_m_s": figures(0.2, 0.223607, 0.3),
                "behaviors": behaviors,
                "estimators": [{"name": "mocap", "start_s": 0.0}],
                "min_battery": 0.93,
                "min_clearance_m": 0.25,
                "foreign_commands": [],
            }
        },
        "flows": {},
        "expectations": [
            {
                "text": "finished within 60 s",
                "held": True,
                "value": 41.25,
                "margin": 18.75,
                "when_s": None,
                "unit": "s",
                "at": "m.yaml:31",
                "unknown_s": 0.0,
            }
        ],
        "never_injected": [],
        "commands": [],
        "recording": None,
    }


@pytest.mark.parametrize(
    ("verdicts", "ending", "expected"),
    [
        ([HELD], Ending(unheard=["mk"]), ("failed", "mk was not heard at the end")),
        (
            [HELD],
            Ending("interrupted", interrupted=True, recording="the disk is full"),
            ("interrupted", "interrupted; the disk is full"),
        ),
        ([HELD], Ending(), ("succeeded", None)),
        ([HELD, BROKEN], Ending(), ("failed", f"1 of 2 expectations did not hold: {UNMET}")),
        (
            [BROKEN, HELD, NEVER],
            Ending(),
            ("failed", f"2 of 3 expectations did not hold, first {UNMET}"),
        ),
        ([HELD], Ending("not finished in time"), ("failed", "not finished in time")),
        ([HELD], Ending(in_air={"mk"}), ("failed", "mk ended in the air")),
        ([HELD], Ending(recording="disk full"), ("failed", "disk full")),
        ([BROKEN], Ending("interrupted", interrupted=True), ("interrupted", "interrupted")),
        ([HELD], Ending(interrupted=True, driver="link lost"), ("driver_failed", "link lost")),
        (
            [BROKEN],
            Ending("late", in_air={"mk"}),
            ("failed", "late; mk ended in the air; 1 of 1 expectations did not hold"),
        ),
    ],
)
def test_the_gravest_decides(verdicts, ending, expected):
    assert decide(flown_score(), verdicts, ending) == expected


def test_before_anything_flew_no_expectation_is_a_reason():
    score = Score(make_plan("mk"))
    assert decide(score, [BROKEN], Ending("preflight")) == ("failed", "preflight")


@pytest.mark.parametrize(
    ("verdict", "shown"),
    [
        (HELD, "41.2 s"),
        (BROKEN, "3.12 cm, off by 2.12 cm"),
        (
            BROKEN._replace(text="always a.b < 1 m", when=12.34),
            "3.12 cm at 12.34 s, off by 2.12 cm",
        ),
        (NEVER, "never"),
        (
            NEVER._replace(value=1.2, margin=-0.2, unit="m", when=3.0),
            "nearest: 1.2 m at 3 s, off by 20 cm",
        ),
        (NEVER._replace(text="finally mk in landed"), ""),
    ],
)
def test_a_measured_value_says_when_and_how_far_off(verdict, shown):
    assert measured(*verdict[:5], verdict.when) == shown


def test_nobody_knows_where_a_vehicle_is_that_is_not_heard():
    figures = {"seed": 0, "sim_time_s": 1.0, "wall_time_s": 1.0}
    summary = summarise(make_plan("mk"), flown_score(), [], Ending(unheard=["mk"]), **figures)
    assert summary["vehicles"]["mk"]["final"] == "unknown"


def test_a_vehicle_that_rests_in_fault_fails_the_mission():
    score = flown_score()
    score.vehicle("mk").entered("fault", "wait_on_ground", 9.0)
    assert decide(score, [HELD], Ending()) == ("failed", "mk ended in `fault`")


def test_every_outcome_has_its_exit_code():
    assert EXIT_CODES == {"succeeded": 0, "failed": 1, "driver_failed": 3, "interrupted": 130}
    assert INVALID == 2


def test_a_run_without_samples_or_time_is_valid_json():
    endless = Verdict("always mk.state.speed < 1", False, float("inf"), None, "m/s", "m.yaml:1")
    plan = make_plan("mk", "nano")
    summary = summarise(
        plan, Score(plan), [endless], Ending("preflight"), seed=0, sim_time_s=0.0, wall_time_s=0.0
    )
    json.dumps(summary, allow_nan=False)
    assert summary["real_time_factor"] is None
    assert summary["expectations"][0]["value"] is None
    assert summary["vehicles"]["nano"]["position_error_m"] is None
    assert summary["vehicles"]["nano"]["min_battery"] is None
