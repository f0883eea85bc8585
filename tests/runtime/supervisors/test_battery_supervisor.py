"""battery (supervisor): warns, then lands, and does not flutter."""

from part_bench import SITE, tick

from kybflow.core.params import fields_of
from kybflow.core.signals import NS, Alarm, Battery, BatteryWarning, Reaction
from kybflow.runtime.supervisors.battery import BatterySupervisor, BatterySupervisorParams


def check(supervisor: BatterySupervisor, left: float, off_ground: bool = True) -> Alarm | None:
    return supervisor.check(tick(battery=Battery(0, left, 14.0)), off_ground)


def reactions(*charges: float) -> str:
    """What each charge in turn leads to: nothing (-), a warning (w) or a landing (L)."""
    supervisor = BatterySupervisor(BatterySupervisorParams(), SITE)
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
    assert expected == check(BatterySupervisor(BatterySupervisorParams(), SITE), 0.14)


def test_on_the_ground_it_only_warns() -> None:
    alarm = check(BatterySupervisor(BatterySupervisorParams(), SITE), 0.1, off_ground=False)
    assert alarm == Alarm("battery_low", Reaction.WARN, "10% left, below 30%", 0.1, 0.3)


def test_without_a_report_it_is_silent() -> None:
    assert BatterySupervisor(BatterySupervisorParams(), SITE).check(tick(), off_ground=True) is None


def test_a_report_that_grows_old_is_a_warning_until_the_next_one() -> None:
    supervisor, report = BatterySupervisor(BatterySupervisorParams(), SITE), Battery(NS, 0.8, 14.0)
    for off_ground in (False, True):
        assert supervisor.check(tick(6.0, battery=report), off_ground) is None
        assert supervisor.check(tick(6.5, battery=report), off_ground) == Alarm(
            "battery_lost", Reaction.WARN, "its last report is 5.5 s old, 5 s allowed", 5.5, 5.0
        )
    assert supervisor.check(tick(6.6, battery=report._replace(time=6 * NS)), True) is None


def test_an_old_report_of_an_empty_battery_lands() -> None:
    supervisor = BatterySupervisor(BatterySupervisorParams(), SITE)
    alarm = supervisor.check(tick(9.0, battery=Battery(0, 0.1, 14.0)), off_ground=True)
    assert alarm is not None
    assert (alarm.event, alarm.reaction) == ("battery_low", Reaction.LAND)


def test_in_flight_it_may_only_become_younger() -> None:
    [age] = [f for f in fields_of(BatterySupervisorParams) if f.name == "age"]
    assert age.tightens == "down"


def test_what_the_vehicle_says_of_its_battery_counts_though_the_charge_seems_well() -> None:
    supervisor = BatterySupervisor(BatterySupervisorParams(), SITE)
    low, urgent = BatteryWarning("it says 'low'", False), BatteryWarning("it says 'empty'", True)
    told = [
        supervisor.check(tick(battery=Battery(0, 0.9, 9.9, warning)), off_ground)
        for warning, off_ground in ((low, True), (urgent, True), (urgent, False), (None, True))
    ]
    assert told == [
        Alarm("battery_low", Reaction.WARN, "it says 'low'; 90% left", 0.9),
        Alarm("battery_low", Reaction.LAND, "it says 'empty'; 90% left", 0.9),
        Alarm("battery_low", Reaction.WARN, "it says 'empty'; 90% left", 0.9),
        None,
    ]


def test_what_the_vehicle_says_takes_nothing_from_a_charge_that_is_low() -> None:
    supervisor = BatterySupervisor(BatterySupervisorParams(), SITE)
    low = BatteryWarning("it says 'low'", False)
    alarm = supervisor.check(tick(battery=Battery(0, 0.14, 9.9, low)), off_ground=True)
    assert alarm == Alarm("battery_low", Reaction.LAND, "14% left, below 15%", 0.14, 0.15)
