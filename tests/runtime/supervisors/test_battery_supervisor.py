"""battery (supervisor): warns, then lands, and does not flutter."""

from flying import SITE, tick

from kybflow.runtime.supervisors.battery import Battery, BatteryParams
from kybflow.signals import Alarm, Reaction
from kybflow.signals import Battery as Report


def check(supervisor: Battery, left: float, airborne: bool = True) -> Alarm | None:
    return supervisor.check(tick(battery=Report(0, left, 14.0)), airborne)


def reactions(*charges: float) -> str:
    """What each charge in turn leads to: nothing (-), a warning (w) or a landing (L)."""
    supervisor = Battery(BatteryParams(), SITE)
    letters = {None: "-", Reaction.WARN: "w", Reaction.LAND: "L"}
    alarms = [check(supervisor, left) for left in charges]
    return "".join(letters[alarm.reaction if alarm else None] for alarm in alarms)


def test_it_warns_and_then_lands() -> None:
    assert reactions(0.3, 0.29, 0.14) == "-wL"


def test_a_charge_that_comes_back_a_little_changes_nothing() -> None:
    assert reactions(0.14, 0.19, 0.21) == "LLw"
    assert reactions(0.29, 0.34, 0.36, 0.31) == "ww--"


def test_the_alarm_says_what_is_left_and_what_is_needed() -> None:
    expected = Alarm("battery_low", Reaction.LAND, "14% left, below 15%", 0.14, 0.15)
    assert expected == check(Battery(BatteryParams(), SITE), 0.14)


def test_on_the_ground_it_only_warns() -> None:
    alarm = check(Battery(BatteryParams(), SITE), 0.1, airborne=False)
    assert alarm == Alarm("battery_low", Reaction.WARN, "10% left, below 30%", 0.1, 0.3)


def test_without_a_report_it_is_silent() -> None:
    assert Battery(BatteryParams(), SITE).check(tick(), airborne=True) is None
