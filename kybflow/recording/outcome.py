"""The result of a run: its outcome, the exit code and `summary.json`.

The summary is stable: fields are added, never renamed. Lengths are metres, speeds m/s, times
seconds; numbers have six significant digits; null is "not known" or "does not apply".

- `outcome`: succeeded, failed, interrupted or driver_failed; `reason`: why it did not succeed.
- `world`: what its vehicles flew in: `a lab`, `still air`, `real`; figures are good for that.
- `vehicles.NAME.final`: ground or air, in simulation as the truth has it. Errors are between what
  the behavior wanted, before processors, and the true position (the estimate on hardware), while
  the vehicle was in the air: over the intervals `airborne_s`, the last of which ends with null
  where the run ended first.
- `vehicles.NAME.behaviors`: one entry for each time a state was entered; `ended` is done, next,
  failed, within, refused, asked, failsafe or run_ended.
- `vehicles.NAME.estimators`: from when on each was used; an empty name: none was healthy.
- `vehicles.NAME.foreign_commands`: what somebody else commanded it, beside this program.
- `flows.NAME.phases`: one entry for each time a phase was entered; `ended` is next, within, done
  (its vehicles have left what it asked for), asked, operator or run_ended.
- `expectations`: each line of `expect:`; `margin` is positive when it held, in the value's `unit`.
- `recording`: null when complete, else why the recording stopped.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from kybflow.core.exit_codes import DRIVER_FAILED, FAILED, INTERRUPTED
from kybflow.dsl.plan import Plan
from kybflow.runtime.scores import Score, rounded

if TYPE_CHECKING:
    from kybflow.runtime.expectations import Verdict

Outcome = Literal["succeeded", "failed", "interrupted", "driver_failed"]

EXIT_CODES: Mapping[Outcome, int] = {
    "succeeded": 0,
    "failed": FAILED,
    "driver_failed": DRIVER_FAILED,
    "interrupted": INTERRUPTED,
}


@dataclass(frozen=True, slots=True)
class Ending:
    """How the engine stopped.

    reason: why the mission was not flown to its end, None when it was. driver: what a driver or
    device said when it failed. recording: why the recording stopped before the run did. airborne:
    the vehicles that were not on the ground at the end. expected_faults:
    those that the mission expects to end in `fault`.
    """

    reason: str | None = None
    interrupted: bool = False
    driver: str | None = None
    recording: str | None = None
    airborne: Collection[str] = ()
    expected_faults: Collection[str] = ()


def decide(score: Score, verdicts: Sequence[Verdict], ending: Ending) -> tuple[Outcome, str | None]:
    """The outcome, the most serious one that applies, and its reason; None for a success."""
    if ending.driver is not None:
        return "driver_failed", ending.driver
    if ending.interrupted:
        return "interrupted", ending.reason or "interrupted"
    reasons = [
        ending.reason,
        _failures(score),
        _faults(score, ending.expected_faults),
        _in_the_air(ending.airborne),
        _broken(verdicts),
        ending.recording,
    ]
    found = [reason for reason in reasons if reason]
    return ("failed", "; ".join(found)) if found else ("succeeded", None)


def summarise(
    plan: Plan,
    score: Score,
    verdicts: Sequence[Verdict],
    ending: Ending,
    *,
    seed: int,
    sim_time_s: float,
    wall_time_s: float,
    flows: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The content of `summary.json`."""
    outcome, reason = decide(score, verdicts, ending)
    return {
        "kybflow": 1,
        "mission": plan.mission,
        "outcome": outcome,
        "reason": reason,
        "seed": seed,
        "target": plan.target,
        "world": "; ".join(_worlds(plan)),
        "sim_time_s": rounded(sim_time_s),
        "wall_time_s": rounded(wall_time_s),
        "real_time_factor": rounded(sim_time_s / wall_time_s) if wall_time_s > 0.0 else None,
        "vehicles": {
            name: vehicle.record(name in ending.airborne)
            for name, vehicle in score.vehicles.items()
        },
        "flows": dict(flows or {}),
        "expectations": [_expectation(verdict) for verdict in verdicts],
        "recording": ending.recording,
    }


def _worlds(plan: Plan) -> list[str]:
    """What its vehicles fly in."""
    drivers = [vehicle.driver for vehicle in plan.vehicles]
    found = [driver.cls.world(driver.params) or "real" for driver in drivers]
    return list(dict.fromkeys(found))


def _failures(score: Score) -> str:
    """Behaviors that failed where the mission has no `failed` transition for it."""
    found = [f"{v.name}: {failure}" for v in score.vehicles.values() for failure in v.failures]
    return "; ".join(found)


def _faults(score: Score, expected: Collection[str]) -> str:
    """Vehicles that ended in `fault` where the mission does not expect it."""
    ended = {v.name: v.behaviors[-1].name for v in score.vehicles.values() if v.behaviors}
    names = [name for name, state in ended.items() if state == "fault" and name not in expected]
    return f"{' and '.join(names)} ended in `fault`" if names else ""


def _in_the_air(names: Collection[str]) -> str:
    return f"{' and '.join(names)} ended in the air" if names else ""


def _broken(verdicts: Sequence[Verdict]) -> str:
    broken = [verdict.text for verdict in verdicts if not verdict.held]
    if not broken:
        return ""
    return f"{len(broken)} of {len(verdicts)} expectations did not hold: " + "; ".join(broken)


def _expectation(verdict: Verdict) -> dict[str, Any]:
    return {
        "text": verdict.text,
        "held": verdict.held,
        "value": _number(verdict.value),
        "margin": _number(verdict.margin),
        "unit": verdict.unit,
        "at": verdict.at,
    }


def _number(value: float | None) -> float | None:
    return rounded(value) if value is not None and math.isfinite(value) else None
