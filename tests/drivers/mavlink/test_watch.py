"""What the preflight asks of an autopilot that is not ready, and what mends it."""

from __future__ import annotations

from fake import Bench, estimate

RUN_PREARM_CHECKS = 401


def looked(bench: Bench, seconds: float):
    """The last checks, by name, while it is told where it is."""
    for _ in range(round(seconds * 50)):
        bench.tick()
        bench.link.tell(estimate(bench.now), bench.now)
        checks = bench.link.checks(bench.now)
    return {check.name: check for check in checks}


def test_one_that_stays_unready_is_asked_why_and_its_words_are_shown():
    bench = Bench()
    bench.fake.ready = False
    looked(bench, 3.0)
    assert bench.fake.commands(RUN_PREARM_CHECKS) == []
    looked(bench, 1.0)
    assert len(bench.fake.commands(RUN_PREARM_CHECKS)) == 1
    bench.fake.say("Preflight Fail: no battery")
    assert "Preflight Fail: no battery" in looked(bench, 0.5)["autopilot"].reason
    looked(bench, 20.0)
    assert len(bench.fake.commands(RUN_PREARM_CHECKS)) == 3


def test_one_that_is_ready_is_asked_nothing():
    bench = Bench()
    looked(bench, 2.0)
    assert looked(bench, 10.0)["autopilot"].green
    assert bench.fake.commands(RUN_PREARM_CHECKS) == []


def test_what_mends_its_parameters_is_a_command_for_this_very_vehicle():
    plain = looked(Bench(), 5.0)["parameters"].reason
    assert "`kybflow mavlink setup --vehicle px4 --system 1 --write`" in plain
    told = {"address": "udpin:127.0.0.1:14555", "own_system": 250, "simulator": True}
    other = looked(Bench(**told), 5.0)["parameters"].reason
    words = "--system 1 --address udpin:127.0.0.1:14555 --own-system 250 --simulator --write`"
    assert words in other
