"""Every fault in every state of the missions about faults: down it comes, and gently.

The fast part breaks a few states once; the slow part all of them with twenty seeds. A fault that is
added to the catalog is broken here by itself.
"""

from __future__ import annotations

import functools

import pytest
from fault_study import (
    BLINDING,
    COURIERS,
    STUDIED,
    Case,
    Seen,
    cases,
    faulty_flight,
    plan_of,
    study,
)

from kybflow.parts.catalog import load_catalog

FARTHEST, FASTEST, NOISE = 0.3, 1.5, 0.02
"""Off the setpoint with an estimator in use, m; down blindly, m/s; what one vehicle's fault may
change for another, m."""
TOUCHES_BOTH = frozenset({"mocap_swap", "camera_swapped"})


@functools.cache
def undisturbed(mission: str, vehicle: str) -> Seen:
    return faulty_flight(plan_of(mission), vehicle, 0)[0]


def held(case: Case, seen: Seen) -> list[str]:
    """What the vehicle or the others did that they must not."""
    wrong = []
    if seen.restless:
        wrong.append(f"not on the ground: {seen.restless}")
    if seen.off > FARTHEST:
        wrong.append(f"{seen.off:.3f} m off with an estimator in use")
    if seen.blind > FASTEST:
        wrong.append(f"came down blindly with {seen.blind:.2f} m/s")
    if case.fault not in TOUCHES_BOTH:
        calm = undisturbed(case.mission, case.vehicle)
        if seen.other > calm.other + NOISE:
            wrong.append(f"the others were {seen.other:.3f} m off, {calm.other:.3f} m in peace")
    return wrong


@pytest.mark.parametrize(
    ("state", "fault"),
    [
        pytest.param("round", "gust", marks=pytest.mark.thorough),
        pytest.param("round", "imu_bias_step", marks=pytest.mark.thorough),
        pytest.param("still", "mocap_noise", marks=pytest.mark.thorough),
        pytest.param("up", "mass_change", marks=pytest.mark.thorough),
        ("land_blind", "rotor_weak"),
    ],
)
def test_a_fault_now_and_then(state: str, fault: str) -> None:
    case = Case("fallback", "nano", state, fault)
    seen = study(case, range(1))
    assert seen.injected
    assert held(case, seen) == []


@pytest.mark.thorough
def test_noise_where_the_thrust_has_just_collapsed() -> None:
    """What shakes the tilt must not take the thrust that is left."""
    case = Case("two_lives", "sick", "auto_land", "mocap_noise")
    seen = study(case, range(7, 8))
    assert seen.injected
    assert held(case, seen) == []


@pytest.mark.thorough
def test_two_bodies_that_are_exchanged_bring_neither_off_its_way() -> None:
    seen = study(Case("two_lives", "well", "eight", "mocap_swap"), range(1))
    assert seen.injected
    assert max(seen.off, seen.other) <= FARTHEST
    assert seen.blind <= FASTEST
    assert seen.restless == []


@pytest.mark.thorough
def test_two_couriers_whose_cameras_are_exchanged_come_down() -> None:
    case = Case(COURIERS, "courier", "out", "camera_swapped")
    seen = study(case, range(1))
    assert seen.injected
    assert held(case, seen) == []


@pytest.mark.thorough
def test_the_study_has_every_fault_of_the_catalog() -> None:
    studied = {case.fault for mission in STUDIED for case in cases(mission)}
    assert studied == set(load_catalog().names("faults"))


@pytest.mark.slow
@pytest.mark.parametrize("fault", BLINDING)
def test_whatever_takes_the_couriers_estimate_away_in_any_state(fault: str) -> None:
    wrong = {str(c): held(c, study(c, range(2))) for c in cases(COURIERS) if c.fault == fault}
    assert wrong
    assert {case: found for case, found in wrong.items() if found} == {}


@pytest.mark.slow
@pytest.mark.parametrize("mission", STUDIED)
@pytest.mark.parametrize("fault", load_catalog().names("faults"))
def test_every_fault_in_every_state_with_every_seed(mission: str, fault: str) -> None:
    wrong = {
        str(case): held(case, study(case, range(20)))
        for case in cases(mission)
        if case.fault == fault
    }
    assert {case: found for case, found in wrong.items() if found} == {}
