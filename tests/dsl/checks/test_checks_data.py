"""Data types from behavior to driver, with parts made up for it: those of the catalog all fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from plans import NANO, plan, state

from kybflow.core.signals import Battery, CommandKind, Pose, SetpointKind
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.data import chains_that_do_not_connect, control_rates, missing_measurements
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import EstimatorPlan, PartPlan, VehiclePlan
from kybflow.parts import AIR, GROUND, Leg
from kybflow.parts.catalog import PartSpec

POSITION, VELOCITY = SetpointKind.POSITION, SetpointKind.VELOCITY
ATTITUDE = CommandKind.ATTITUDE_THRUST


def use(name: str, **facts: Any) -> PartPlan:
    """A part of which the checks see these facts."""
    cls: Any = SimpleNamespace(
        takes=lambda _: facts["accepts"], kinds=lambda _: facts["gives"], **facts
    )
    return PartPlan(name, cls, None, name)


def behavior(emits: SetpointKind | CommandKind, *flight: Leg) -> PartPlan:
    return use("fly", emits=emits, flight=flight or (AIR >> AIR,))


def driver(**more: Any) -> PartPlan:
    facts = {
        "accepts": frozenset({ATTITUDE}),
        "provides": frozenset({Pose}),
        "step_rate": lambda _: 500.0,
        "shows": lambda _: False,
        "tracker": lambda _: None,
    }
    return use("bench", **{**facts, **more})


class Parts:
    """A catalog in which every built-in behavior stays on the ground."""

    def get(self, kind: str, name: str) -> Any:
        if kind == "trackers":
            given = {"never": CommandKind.RATES_THRUST, "fits": ATTITUDE}[name]
            made = use(name, accepts=frozenset({POSITION}), gives=frozenset({given}))
        else:
            assert name in BUILT_IN.values()
            made = behavior(SetpointKind.IDLE, GROUND >> GROUND)
        return PartSpec(kind, name, made.cls, type(None), (), name)

    def names(self, kind: str) -> tuple[str, ...]:
        return ("never", "fits") if kind == "trackers" else ()


def case(flown: PartPlan, control_rate: int = 250, **parts: Any) -> Case:
    facts: dict[str, Any] = {
        "estimators": (),
        "processors": (),
        "tracker": use("cascade", accepts=frozenset({POSITION}), gives=frozenset({ATTITUDE})),
        "driver": driver(),
        **parts,
    }
    vehicle = VehiclePlan(
        name="a",
        airframe=NANO,
        start=(0.0, 0.0, 0.0),
        heading=0.0,
        begin="go",
        states={"go": state("go", flown)},
        **facts,
    )
    mission = plan(vehicle, target="lab", control_rate=control_rate)
    catalog: Any = Parts()
    return Case(mission, catalog)


def messages(found: Any) -> list[str]:
    return [f"{d.code} {d.message}: {d.label}" for d in found]


INTEGRATE = use("integrate", accepts={VELOCITY: POSITION}, safety=False)
LIMIT = use("limit", accepts={POSITION: POSITION}, safety=True)
REFUSED = "can't take the velocity setpoints of `go` (fly): takes `position`"
COMMANDS = "KYB301 `bench` can't take the attitude_thrust commands of"


@pytest.mark.parametrize(
    ("flown", "expected"),
    [
        pytest.param(case(behavior(POSITION)), [], id="it connects"),
        pytest.param(case(behavior(VELOCITY)), [f"KYB301 `cascade` {REFUSED}"], id="tracker"),
        pytest.param(
            case(behavior(VELOCITY), processors=(INTEGRATE,)), [], id="a processor turns the kind"
        ),
        pytest.param(
            case(behavior(VELOCITY), processors=(LIMIT,)),
            [f"KYB301 `limit` {REFUSED}"],
            id="processor",
        ),
        pytest.param(
            case(behavior(POSITION, GROUND >> AIR), processors=(INTEGRATE,)),
            [],
            id="only safety processors apply in a take-off",
        ),
        pytest.param(
            case(behavior(ATTITUDE), driver=driver(accepts=frozenset())),
            [f"{COMMANDS} `cascade`: takes nothing", f"{COMMANDS} `go` (fly): takes nothing"],
            id="driver",
        ),
    ],
)
def test_a_part_takes_what_the_one_before_it_gives(flown: Case, expected: list[str]) -> None:
    assert messages(chains_that_do_not_connect(flown)) == expected


def test_a_tracker_may_give_several_kinds_and_one_that_fits_is_named() -> None:
    everything = frozenset({ATTITUDE, CommandKind.POSITION, CommandKind.VELOCITY})
    many = use("many", accepts=frozenset({POSITION}), gives=everything)
    flown = case(behavior(POSITION), tracker=many)
    (found,) = chains_that_do_not_connect(flown)
    commands = "the position and velocity commands of `many`"
    assert found.message == f"`bench` can't take {commands}"
    assert found.help == "write `targets: {lab: {a: {tracker: fits}}}`"


def test_measurements_that_nobody_provides() -> None:
    needs = frozenset({Pose, Battery})
    estimator = EstimatorPlan(part=use("mocap", uses=lambda _: needs), recover_after=1.0)
    flown = case(behavior(POSITION), estimators=(estimator,))
    expected = ["KYB302 `mocap` needs battery measurements: `bench` provides `pose`"]
    assert expected == messages(missing_measurements(flown))


def test_control_rates_that_divide_the_steps() -> None:
    assert messages(control_rates(case(behavior(POSITION), 125))) == []
    any_rate = driver(step_rate=lambda _: None)
    assert messages(control_rates(case(behavior(POSITION), 77, driver=any_rate))) == []


def test_a_control_rate_that_does_not() -> None:
    found = list(control_rates(case(behavior(POSITION), 300)))
    assert (messages(found)) == [
        "KYB303 control at 300 Hz does not divide `bench` at 500 Hz: 500 / 300 = 1.667"
    ]
    assert [d.help for d in found] == ["use 250 Hz"]
