"""link: heard when nothing arrives any more."""

from part_bench import SITE, tick

from kybflow.core.signals import Alarm, Reaction
from kybflow.runtime.supervisors.link import LinkSupervisor, LinkSupervisorParams


def test_a_silence_lands() -> None:
    silent = tick()._replace(link_age=0.6)
    expected = Alarm(
        "link_lost", Reaction.LAND, "no measurement has arrived for 0.60 s, 0.5 s allowed", 0.6, 0.5
    )
    assert expected == LinkSupervisor(LinkSupervisorParams(), SITE).check(silent, off_ground=True)


def test_a_slow_link_lands_and_tells_its_delay_and_the_bound() -> None:
    slow = tick()._replace(link_delay=0.31)
    reason = "two round trips in a row took 0.31 s and more, 0.2 s allowed"
    expected = Alarm("link_slow", Reaction.LAND, reason, 0.31, 0.2)
    assert expected == LinkSupervisor(LinkSupervisorParams(), SITE).check(slow, off_ground=True)
    quick = tick()._replace(link_delay=0.2)
    assert LinkSupervisor(LinkSupervisorParams(), SITE).check(quick, off_ground=True) is None


def test_within_its_age_and_on_the_ground_it_is_silent() -> None:
    assert (
        LinkSupervisor(LinkSupervisorParams(), SITE).check(
            tick()._replace(link_age=0.5), off_ground=True
        )
        is None
    )
    assert (
        LinkSupervisor(LinkSupervisorParams(), SITE).check(
            tick()._replace(link_age=9.0), off_ground=False
        )
        is None
    )
