"""Commands and their one spelling, and who may give them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.errors import CommandUnreadable
from kybflow.dsl.plan import Emit, Enable, EnterPhase, Perform, SetOption, Stop, Switch
from kybflow.runtime.commanding.orders import (
    MOST_LETTERS,
    SCHEDULE,
    LandOrder,
    Lease,
    PauseOrder,
    ReleaseLease,
    ResetOrder,
    ResumeOrder,
    parse,
    text,
)

SPELLED = {
    "emit operator.go": Emit("operator.go"),
    "switch mk eight.first": Switch("mk", "eight.first"),
    "switch mk goto position=[1, 0, 1] speed=50 cm/s": Switch(
        "mk", "goto", (("position", "[1, 0, 1]"), ("speed", "50 cm/s"))
    ),
    "set mk.processors.limit_speed.speed 50 cm/s": SetOption(
        "mk.processors.limit_speed.speed", "50 cm/s"
    ),
    "enable mk.processors.smooth": Enable("mk", "processors.smooth", True),
    "disable mk.processors.smooth": Enable("mk", "processors.smooth", False),
    "phase swarm gather": EnterPhase("swarm", "gather"),
    "perform mk leds_red": Perform("mk", "leds_red"),
    "pause": PauseOrder(),
    "resume mk": ResumeOrder(("mk",)),
    "reset mk nano": ResetOrder(("mk", "nano")),
    "land": LandOrder(),
    "stop": Stop(""),
    "stop it gets dark": Stop("it gets dark"),
    "release": ReleaseLease(),
}


@pytest.mark.parametrize("words", SPELLED)
def test_a_command_is_read_and_written_in_the_same_words(words: str) -> None:
    assert parse(words) == SPELLED[words]
    assert text(SPELLED[words]) == words


def test_the_operator_s_events_are_the_commands_that_they_name() -> None:
    assert parse("emit operator.land") == LandOrder()
    assert parse("emit operator.stop") == Stop("")
    assert parse("emit land") == Emit("land")
    assert parse("pause a a") == PauseOrder(("a",))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "there is no command ``; known here: `disable`, `emit`"),
        ("lnd", r"there is no command `lnd`; did you mean `land`\?"),
        ("switch mk", "`switch` is written `switch VEHICLE STATE"),
        ("switch mk goto up", "`switch` is written `switch VEHICLE STATE"),
        ("switch mk goto a=", "`switch` is written `switch VEHICLE STATE"),
        ("switch mk goto a=1 a=2", "`switch` is written `switch VEHICLE STATE"),
        ("set mk.a.b", "`set` is written `set OPTION VALUE`"),
        ("perform mk", "`perform` is written `perform VEHICLE ACT`"),
        ("enable mk", "`enable` is written `enable VEHICLE.processors.NAME`"),
        ("release me", "`release` is written `release`"),
        ("stop " + "x" * MOST_LETTERS, "a command has at most 1000 letters, not 1005"),
    ],
)
def test_what_is_no_command_is_refused_with_how_it_is_written(words: str, said: str) -> None:
    with pytest.raises(CommandUnreadable, match=f"^{said}"):
        parse(words)


@given(st.text(max_size=80) | st.sampled_from([*SPELLED]).flatmap(lambda w: st.just(w[:-1])))
def test_whatever_is_read_is_written_so_that_it_is_read_again(words: str) -> None:
    try:
        order = parse(words)
    except CommandUnreadable:
        return
    assert parse(text(order)) == order
    assert len(text(order).splitlines()) <= 1


GO = Emit("operator.go")


def test_the_first_who_commands_holds_it_and_a_second_is_refused_by_name() -> None:
    lease = Lease()
    assert lease.objection(GO, "anna", False) is None
    refused = "`anna` commands this run; take the lease (`--take`) to command it"
    assert lease.objection(GO, "ben", False) == refused
    assert lease.objection(ReleaseLease(), "ben", False) == refused
    assert lease.objection(GO, "anna", False) is None


def test_who_takes_it_has_it_and_who_releases_it_does_not() -> None:
    lease = Lease()
    assert lease.objection(GO, "anna", False) is None
    assert lease.objection(GO, "ben", True) is None
    assert lease.holder == "ben"
    assert lease.objection(ReleaseLease(), "ben", False) is None
    assert lease.holder is None


def test_land_pause_and_stop_are_heard_from_anyone_and_take_nothing() -> None:
    lease = Lease()
    for order in (LandOrder(), PauseOrder(("a",)), Stop("")):
        assert lease.objection(order, "ben", True) is None
        assert lease.holder is None
    assert lease.objection(GO, SCHEDULE, False) is None
    assert lease.holder is None
