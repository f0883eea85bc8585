"""The result of a run: its outcome, exit code and `summary.json`.

The format is stable: fields are added but never renamed. Lengths are in metres, speeds in m/s and
times in seconds. Numbers have six significant digits. Null means "unknown" or "doesn't apply".

- `outcome`: succeeded, failed, interrupted or driver_failed; `reason`: why it did not succeed.
- `world`: the environment in which the figures hold, such as `a lab`, `still air` or `real`.
- `missed_ticks`: the ticks that were left out because the computer was late.
- `vehicles.NAME.final`: ground or air, in simulation by the truth; unknown if nothing was heard of
  the vehicle at the end. Its errors are between the behavior's setpoint, before processors, and
  the true position (on hardware, the estimate). They cover the intervals `airborne_s` in the air;
  if the run ended in the air, the last of these ends with null.
- `vehicles.NAME.behaviors`: one entry for each time a state was entered; `ended` is done, next,
  failed, within, refused, asked, failsafe or run_ended.
- `vehicles.NAME.estimators`: when the use of each estimator began; an empty name means that none
  was healthy.
- `vehicles.NAME.foreign_commands`: commands from another program.
- `flows.NAME.phases`: one entry for each time a phase was entered; `ended` is next, within, done
  (its vehicles have left the requested states), asked, operator or run_ended.
- `expectations`: each line of `expect:`; `margin`, in the value's `unit`, is positive if it held;
  `when_s`: when the value was measured, for an `eventually` or `always` that did not hold;
  `unknown_s`: the time in flight for which its value was unknown, so that it says nothing.
- `never_injected`: the faults whose time or condition never came.
- `commands`: the commands of people that were accepted.
- `recording`: null if complete, otherwise why the recording stopped.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from kybflow.core.errors import DRIVER_FAILED, FAILED, INTERRUPTED
from kybflow.core.signals import NS, Event
from kybflow.core.units import format_measured
from kybflow.dsl.plan import FaultPlan, Plan
from kybflow.dsl.resolving.library_files import without_homes
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
    """How a run ended.

    reason: why the mission did not reach its end, None if it did. interrupted: whether a person
    interrupted the run. driver: the error of a driver or device. recording: why the recording
    stopped early. in_air: the vehicles still in the air. unheard: those of which nothing was heard
    at the end, so that nobody knows where they are. expected_faults: the vehicles that the
    mission expects to end in `fault`.
    """

    reason: str | None = None
    interrupted: bool = False
    driver: str | None = None
    recording: str | None = None
    in_air: Collection[str] = ()
    unheard: Collection[str] = ()
    expected_faults: Collection[str] = ()


def decide(score: Score, verdicts: Sequence[Verdict], ending: Ending) -> tuple[Outcome, str | None]:
    """Return the most serious outcome that applies, and its reason; None as the reason of a
    success. If there is another reason, the expectations that did not hold are only counted; if no
    behavior began, they are left out."""
    if ending.driver is not None:
        return "driver_failed", "; ".join(filter(None, (ending.driver, ending.recording)))
    if ending.interrupted:
        why = (ending.reason or "interrupted", ending.recording)
        return "interrupted", "; ".join(filter(None, why))
    vehicles, expected = score.vehicles.values(), ending.expected_faults
    found = [ending.reason] if ending.reason else []
    found += [f"{v.name}: {failure}" for v in vehicles for failure in v.failures]
    ended = {v.name: v.behaviors[-1].name for v in vehicles if v.behaviors}
    faults = [name for name, state in ended.items() if state == "fault" and name not in expected]
    if faults:
        found.append(f"{' and '.join(faults)} ended in `fault`")
    if ending.in_air:
        found.append(f"{' and '.join(ending.in_air)} ended in the air")
    if ending.unheard:
        found.append(f"{' and '.join(ending.unheard)} was not heard at the end")
    broken = [verdict for verdict in verdicts if ended and not verdict.held]
    if broken:
        count, first = f"{len(broken)} of {len(verdicts)} expectations did not hold", broken[0]
        how = measured(*first[:5], first.when)
        which = f"{', first' if broken[1:] else ':'} `{first.text}`{': ' if how else ''}{how}"
        place = f"  [{without_homes(first.at)}]" if first.at else ""
        found.append(count if found else f"{count}{which}{place}")
    found += [ending.recording] if ending.recording else []
    return ("failed", "; ".join(found)) if found else ("succeeded", None)


def measured(
    text: str,
    held: bool,
    value: float | None,
    margin: float | None,
    unit: str,
    when: float | None,
) -> str:
    """Return the measured value of an expectation, its time if that is known, and how far it is
    beyond the bound; empty if there is none. The arguments are those of `Verdict`."""
    is_eventual = text.startswith("eventually")
    if value is None:
        return "never" if is_eventual and not held else ""
    words = format_measured(value, unit)
    if when is not None:
        words = f"{'nearest: ' if is_eventual else ''}{words} at {when:.4g} s"
    if held or margin is None or margin >= 0.0:
        return words
    return f"{words}, off by {format_measured(-margin, unit)}"


def summarise(
    plan: Plan,
    score: Score,
    verdicts: Sequence[Verdict],
    ending: Ending,
    *,
    seed: int,
    sim_time_s: float,
    wall_time_s: float,
    missed_ticks: int = 0,
    flows: Mapping[str, Any] | None = None,
    never_injected: Iterable[FaultPlan] = (),
    commands: Iterable[Event] = (),
) -> dict[str, Any]:
    """Return the content of `summary.json`."""
    outcome, reason = decide(score, verdicts, ending)
    drivers = [vehicle.driver for vehicle in plan.vehicles]
    worlds = dict.fromkeys(driver.cls.world(driver.params) or "real" for driver in drivers)
    return {
        "kybflow": 1,
        "mission": plan.mission,
        "outcome": outcome,
        "reason": reason,
        "seed": seed,
        "target": plan.target,
        "world": "; ".join(worlds),
        "sim_time_s": rounded(sim_time_s),
        "wall_time_s": rounded(wall_time_s),
        "real_time_factor": rounded(sim_time_s / wall_time_s) if wall_time_s > 0.0 else None,
        "missed_ticks": missed_ticks,
        "vehicles": {
            name: {"final": _final(name, ending), **vehicle.record()}
            for name, vehicle in score.vehicles.items()
        },
        "flows": dict(flows or {}),
        "expectations": [
            {
                "text": verdict.text,
                "held": verdict.held,
                "value": _number(verdict.value),
                "margin": _number(verdict.margin),
                "when_s": _number(verdict.when),
                "unit": verdict.unit,
                "at": without_homes(verdict.at),
                "unknown_s": rounded(verdict.unknown),
            }
            for verdict in verdicts
        ],
        "never_injected": [
            {"fault": plan.part.name, "vehicle": plan.vehicle, "at": without_homes(plan.at)}
            for plan in never_injected
        ],
        "commands": [
            {
                "t_s": rounded(event.time / NS),
                "command": event.fields["command"],
                "by": event.fields["by"],
            }
            for event in commands
        ],
        "recording": ending.recording,
    }


def _final(name: str, ending: Ending) -> str:
    if name in ending.unheard:
        return "unknown"
    return "air" if name in ending.in_air else "ground"


def _number(value: float | None) -> float | None:
    return rounded(value) if value is not None and math.isfinite(value) else None
