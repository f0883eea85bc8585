"""Words that carry a table, and the places that tell them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from plans import plan, vehicle, wrapped
from short_flights import down, up
from typer import Exit

from kybflow.api.flight import Flown, inspect
from kybflow.cli.commands import preflight
from kybflow.cli.commands.preflight import table
from kybflow.cli.printing.flights import EventLines, outcome, sentence
from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Event
from kybflow.core.text import detailed, details, headline
from kybflow.dsl.resolving.library_files import installed
from kybflow.parts import Link
from kybflow.recording.outcome import EXIT_CODES
from kybflow.runtime.preflight import PreflightResult

REASON = detailed("2 are wrong", ["A is 0", "B is 1"])


def test_a_table_can_be_left_out_also_when_such_words_are_joined():
    joined = f"preflight: a: parameters: {REASON}; b: battery: no report; b: more: {REASON}"
    assert headline(joined) == (
        "preflight: a: parameters: 2 are wrong; b: battery: no report; b: more: 2 are wrong"
    )
    assert details(joined) == ["A is 0", "B is 1", "A is 0", "B is 1"]


def test_other_words_stay_as_they_are():
    assert detailed("all is well", []) == "all is well"
    for text in ("", "one line", "two\nlines"):
        assert (headline(text), details(text)) == (text, [])


def test_the_preflight_has_the_table_below_its_line():
    lines = [
        PreflightResult("nano", "link", True, "well"),
        PreflightResult("a", "parameters", False, REASON, "m.yaml:9"),
    ]
    assert table(lines) == [
        "green  nano  link        well",
        "RED    a     parameters  2 are wrong  [m.yaml:9]",
        "                           A is 0",
        "                           B is 1",
    ]


def test_a_run_tells_the_table_with_the_event_and_leaves_its_end_to_the_summary():
    failed = {"check": "parameters", "reason": REASON}
    first, *below = sentence(Event(2 * NS, "preflight_failed", "a", failed, "m.yaml:9")).split("\n")
    assert first.endswith("preflight_failed check=parameters reason=2 are wrong  [m.yaml:9]")
    assert [row.strip() for row in below] == ["A is 0", "B is 1"]
    assert all(row.startswith(" " * 20) for row in below)
    ended = sentence(Event(2 * NS, "run_ended", "", {"reason": f"preflight: a: {REASON}"}, ""))
    assert ended.endswith(" run_ended")


@pytest.mark.parametrize("verbose", [False, True])
def test_passed_checks_are_one_line_per_vehicle_unless_each_is_wanted(verbose):
    lines = []
    write = EventLines(lines.append, verbose=verbose)
    passed = [("a", "link"), ("b", "link"), ("b", "battery"), ("a", "input stick")]
    for name, check in passed:
        write(Event(NS // 2, "preflight_passed", name, {"check": check, "found": "well"}))
    assert len(lines) == (4 if verbose else 0)
    write(Event(NS, "behavior_started", "a", {"behavior": "up"}))
    if not verbose:
        assert lines == [
            "   0.50 s  a        preflight: 2 checks passed",
            "   0.50 s  b        preflight: 2 checks passed",
            "   1.00 s  a        behavior_started up",
        ]


def test_a_line_of_an_installed_library_is_named_as_it_is_imported():
    home = installed("kybflow")
    line = sentence(Event(NS, "body_lost", "a", {}, f"{home}/defaults.yaml:7"))
    assert line.endswith("  [kybflow/missions/library/defaults.yaml:7]")


def told(factor: float | None, *, has_pace: bool, reason: str | None = None) -> list[str]:
    """The summary that `kybflow run` prints."""
    summary = {
        "mission": "m", "outcome": "failed" if reason else "succeeded", "reason": reason,
        "expectations": [], "vehicles": {}, "never_injected": [], "commands": [],
        "sim_time_s": 3.0, "wall_time_s": 10.0, "real_time_factor": factor,
    }  # fmt: skip
    return list(outcome(Flown(Path("runs/x"), summary), has_pace=has_pace))


@pytest.mark.parametrize(
    ("factor", "shown"),
    [(0.301, "0.3"), (0.0449, "0.04"), (0.97, "1"), (1.0, "1"), (9.7, "10"), (51.4, "51")],
)
def test_a_slow_run_says_how_slow_it_was(factor, shown):
    [_, last] = told(factor, has_pace=True)
    assert last == f"3.0 s flown in 10.0 s ({shown} x real time), recorded in runs/x"


@pytest.mark.parametrize(("factor", "has_pace"), [(1.0, False), (None, True)])
def test_no_pace_is_shown_where_there_is_none(factor, has_pace):
    [_, last] = told(factor, has_pace=has_pace)
    assert last == "3.0 s flown in 10.0 s, recorded in runs/x"


def test_the_summary_does_not_tell_the_table_again():
    [first, _] = told(1.0, has_pace=False, reason=f"preflight: a: parameters: {REASON}")
    assert first == "m FAILED: preflight: a: parameters: 2 are wrong"


class Unplugged(Link):
    """Nobody is at the other end, which shows only after a while."""

    def read(self, now):
        if now >= NS:
            raise DriverError("system 1 was silent for 10 s")
        return ()

    def send(self, command, now):
        """Nobody hears it."""


def test_the_preflight_of_a_missing_device_ends_as_its_run_does(run, capsys, monkeypatch):
    own = vehicle("a", [up("down"), down()], driver=wrapped(lambda _, link: Unplugged()))
    found = inspect(plan(own))
    assert found.driver_failed == "DriverError: system 1 was silent for 10 s"
    assert [line.check for line in found.lines] == ["link"]
    flown, _ = run(own)
    result = SimpleNamespace(texts={})
    monkeypatch.setattr(preflight, "compiled", lambda *_: (plan(own), result))
    with pytest.raises(Exit) as end:
        preflight.command(Path("m.yaml"), sets=[], parts=[])
    assert end.value.exit_code == flown.exit_code == EXIT_CODES["driver_failed"]
    printed = " ".join(capsys.readouterr().out.split())
    assert "RED a link DriverError: system 1 was silent for 10 s" in printed
