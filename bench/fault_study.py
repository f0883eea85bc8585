"""Every fault in every state of a mission: what it does to the vehicle, and to the others.

    python bench/fault_study.py [--seeds 20] [--only FAULT] [MISSION ...]

The faults are those of the catalog, so a new one is in the study by itself, with the parameters of
`SIZES` or its own defaults; each begins half a second after its state was entered and lasts two
seconds. What is measured, by the simulator's truth:

off: the largest distance from the wanted position while it is off the floor (5 cm), an estimator is
in use and the tracker follows a position, metres. blind: the fastest fall in `land_blind`, m/s.
other: the same as `off`, of every other vehicle. rests: whether all ended on the ground.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from plans import in_still_air  # noqa: E402
from toolchain import MISSIONS, compiled  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.core.geometry import distance  # noqa: E402
from kybflow.core.units import DURATION  # noqa: E402
from kybflow.dsl.expressions import And, Compare, InState, Quantity, Read  # noqa: E402
from kybflow.dsl.plan import FaultPlan, PartPlan, Plan  # noqa: E402
from kybflow.parts.catalog import load_catalog  # noqa: E402
from kybflow.runtime import engine as engine_module  # noqa: E402
from kybflow.runtime.engine import Engine  # noqa: E402

STUDIED = ("fallback", "two_lives")
COURIERS = "two_couriers"
"""The courier beside a neighbour whose camera it may be given: for what takes an estimator away."""
BLINDING = (
    "estimator_killed", "camera_lost", "camera_frozen", "camera_shifted", "camera_swapped",
    "camera_dark", "tags_covered",
)  # fmt: skip
DELAY, LASTS = 0.5, 2.0
FLOOR = 0.05
SIZES: dict[str, dict[str, Any]] = {
    "gust": {"velocity": (1.5, 1.0, 0.0)},
    "wind": {"velocity": (1.0, -0.5, 0.0)},
    "push": {"acceleration": (0.4, -0.3, 0.2)},
    "imu_bias_step": {"gyro": (0.005, -0.005, 0.005), "accelerometer": (0.05, 0.05, -0.05)},
    "mass_change": {"factor": 1.1},
    "mocap_frame": {"exchanged": "xy"},
}
"""Parameters of faults that have no default, or one that breaks nothing."""


@dataclass(frozen=True)
class Case:
    """One fault in one state of one vehicle of a mission."""

    mission: str
    vehicle: str
    state: str
    fault: str

    def __str__(self) -> str:
        return f"{self.mission}-{self.vehicle}-{self.state}-{self.fault}"


@dataclass
class Seen:
    """What one flight showed; `rests` names the vehicles that did not."""

    off: float = 0.0
    blind: float = 0.0
    other: float = 0.0
    restless: list[str] = field(default_factory=list)
    injected: bool = False

    def worst(self, more: Seen) -> Seen:
        return Seen(
            max(self.off, more.off),
            max(self.blind, more.blind),
            max(self.other, more.other),
            self.restless + more.restless,
            self.injected or more.injected,
        )


class Watch:
    """Looks at every tick of a flight."""

    def __init__(self, vehicle: str) -> None:
        self.seen = Seen()
        self._vehicle = vehicle

    def __call__(self, engine: Engine) -> None:
        if not engine.flying:
            return
        for vehicle in engine.vehicles:
            off = self._off(vehicle)
            if vehicle.name == self._vehicle:
                self.seen.off = max(self.seen.off, off)
            else:
                self.seen.other = max(self.seen.other, off)
            if vehicle.state == "land_blind" and vehicle.truth is not None:
                self.seen.blind = max(self.seen.blind, -vehicle.truth.velocity[2])
        self.seen.restless = [v.name for v in engine.vehicles if v.airborne]

    @staticmethod
    def _off(vehicle: Any) -> float:
        wanted, truth = vehicle.followed, vehicle.truth
        if vehicle.estimator is None or truth is None or wanted is None or wanted.position is None:
            return 0.0
        if truth.position[2] - vehicle.plan.start[2] < FLOOR:
            return 0.0
        return distance(wanted.position, truth.position)


def plan_of(mission: str) -> Plan:
    folder = ROOT / "tests" / "flown" if mission == COURIERS else MISSIONS
    plan = compiled(folder / f"{mission}.yaml", warns=True)
    return in_still_air(plan)


def faulty_flight(plan: Plan, vehicle: str, seed: int) -> tuple[Seen, dict[str, Any]]:
    """(what was seen with `vehicle` as the broken one, the summary)."""
    watch, before = Watch(vehicle), engine_module._OBSERVED_EVERY
    engine_module._OBSERVED_EVERY = 1
    try:
        with tempfile.TemporaryDirectory() as folder:
            request = RunRequest(seed=seed, out=Path(folder) / "run")
            told: list[str] = []
            listener = (lambda event: told.append(event.name),)
            summary = fly(plan, request, listener, (watch,)).summary
    finally:
        engine_module._OBSERVED_EVERY = before
    watch.seen.injected = "fault_injected" in told
    return watch.seen, summary


def cases(mission: str) -> Iterator[Case]:
    """Every fault in every state that the mission reaches by itself."""
    plan = plan_of(mission)
    _, summary = faulty_flight(plan, plan.vehicles[0].name, 0)
    broken = plan.vehicles[:1] if mission == COURIERS else plan.vehicles
    for vehicle in broken:
        entered = [b["name"] for b in summary["vehicles"][vehicle.name]["behaviors"]]
        for state in dict.fromkeys(entered):
            for fault in BLINDING if mission == COURIERS else load_catalog().names("faults"):
                if _sized(fault, plan, vehicle.name) is not None:
                    yield Case(mission, vehicle.name, state, fault)


def _sized(fault: str, plan: Plan, vehicle: str) -> PartPlan | None:
    """The fault with its parameters; None for one that needs a vehicle where there is no other."""
    spec = load_catalog().get("faults", fault)
    given = dict(SIZES.get(fault, {}))
    for wanted in spec.fields:
        if wanted.required and wanted.name not in given:
            own = next(v for v in plan.vehicles if v.name == vehicle)
            others = [v.name for v in plan.vehicles if v is not own]
            if wanted.names == "estimator":
                others = [use.part.label.rpartition(".")[2] for use in own.estimators]
            if not others:
                return None
            given[wanted.name] = others[0]
    return PartPlan(fault, spec.cls, spec.params(**given), f"faults.{fault}")


def study(case: Case, seeds: range) -> Seen:
    """The worst of the flights of a case."""
    plan = plan_of(case.mission)
    part = _sized(case.fault, plan, case.vehicle)
    assert part is not None
    there = InState(case.vehicle, case.state)
    late = Compare(">", Read(case.vehicle, "elapsed"), Quantity(DELAY, DURATION))
    broken = FaultPlan(part=part, vehicle=case.vehicle, when=And((there, late)), duration=LASTS)
    plan = replace(plan, faults=(*plan.faults, broken), expectations=())
    worst = Seen()
    for seed in seeds:
        worst = worst.worst(faulty_flight(plan, case.vehicle, seed)[0])
    return worst


def say(what: str, seen: Seen) -> None:
    figures = f"off {seen.off:.3f} blind {seen.blind:.2f} other {seen.other:.3f}"
    missed = "" if seen.injected else "  not injected"
    sys.stdout.write(f"{what:48s} {figures} in the air {seen.restless}{missed}\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("missions", nargs="*", default=(*STUDIED, COURIERS))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", help="one fault")
    options = parser.parse_args()
    for mission in options.missions:
        plan = plan_of(mission)
        for vehicle in plan.vehicles:
            calm, _ = faulty_flight(plan, vehicle.name, 0)
            say(f"{mission}-{vehicle.name}-undisturbed", calm)
        for case in cases(mission):
            if options.only in (None, case.fault):
                seen = study(case, range(options.seeds))
                say(str(case), seen)


if __name__ == "__main__":
    main()
