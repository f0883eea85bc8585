"""estimate (supervisor): heard in the air when nobody knows where the vehicle is."""

import pytest
from part_bench import SITE, estimate, tick

from kybflow.core.signals import NS, Alarm, Reaction
from kybflow.runtime.supervisors.estimate import EstimateSupervisor, EstimateSupervisorParams

HERE = (0.0, 0.0, 1.0)


def supervisor() -> EstimateSupervisor:
    return EstimateSupervisor(EstimateSupervisorParams(), SITE)


def test_without_an_estimate_it_asks_to_land_blind_and_tells_since_when() -> None:
    watch = supervisor()
    watch.check(tick(1.0, estimate(HERE, now=NS, age=0.1)), off_ground=True)
    expected = Alarm(
        "estimate_lost", Reaction.LAND_BLIND, "no estimator has an estimate", 0.35, 0.0
    )
    alarm = watch.check(tick(1.25), off_ground=True)
    assert alarm._replace(value=pytest.approx(alarm.value)) == expected
    assert alarm.value == pytest.approx(0.35)


@pytest.mark.parametrize(
    ("age", "spread", "reason"),
    [
        (0.31, 0.01, "its newest measurement is 0.31 s old, 0.3 s allowed"),
        (0.01, 0.45, "its spread is 0.45 m, 0.3 m allowed"),
    ],
)
def test_an_old_or_vague_estimate_is_a_lost_one(age: float, spread: float, reason: str) -> None:
    alarm = supervisor().check(tick(0.0, estimate(HERE, age=age, spread=spread)), off_ground=True)
    assert alarm is not None
    assert (alarm.event, alarm.reason) == ("estimate_lost", reason)


def test_a_good_estimate_is_none_of_its_business() -> None:
    assert supervisor().check(tick(0.0, estimate(HERE, age=0.3)), off_ground=True) is None


def test_on_the_ground_it_is_silent() -> None:
    assert supervisor().check(tick(), off_ground=False) is None
