"""`kybflow test`: missions flown as tests, in one process and in several."""

import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from toolchain import compiled, invoke

from kybflow.api.flight import Flown
from kybflow.campaigns import cases
from kybflow.campaigns.cases import (
    FlightCase,
    FlightResult,
    StateItem,
    coverage_items,
    fly_case,
    missions_under,
    write_junit,
)
from kybflow.campaigns.session import Pool, coverage_of, exit_code, run_cases
from kybflow.core.text import detailed
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.interrupts import Interrupts

HERE = Path(__file__).parent
GOOD = """kybflow: 1
mission: hop
import: {std: kybflow/airframes}
vehicles:
  nano:
    like: std.nano_plus
    behaviors:
      up: {do: take_off, height: 50 cm, then: down, next: [{when: elapsed > 50 s, go: still}]}
      still: {do: brake, then: down}
      down: {do: land}
expect:
  - finally nano in landed
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "good.yaml").write_text(GOOD)
    (tmp_path / "broken.yaml").write_text(GOOD + "  - max(nano.state.altitude) < 1 cm\n")
    (tmp_path / "invalid.yaml").write_text(GOOD.replace("then: down, n", "then: dwn, n"))
    (tmp_path / "shared.yaml").write_text("library: shared\n")
    return tmp_path


def case(folder: Path, name: str, seed: int = 0) -> FlightCase:
    return FlightCase(folder / f"{name}.yaml", seed, folder / "runs" / f"{name}-{seed}")


LATE = """faults:
  - {at: 100 s, on: nano, inject: link_cut}
"""


def test_a_mission_whose_fault_never_happens_does_not_pass(tmp_path: Path) -> None:
    (tmp_path / "late.yaml").write_text(GOOD + LATE)
    result = fly_case(case(tmp_path, "late"))
    assert (result.verdict, result.passed) == ("failed", False)
    [reason] = result.reason
    assert reason.endswith("late.yaml:14: the fault `link_cut` never happened")


def ran(*arguments: object):
    return invoke("test", *arguments)


def test_a_flight_that_succeeds_leaves_no_folder(folder: Path):
    tried = fly_case(case(folder, "good"))
    assert tried.passed
    assert tried.folder is None
    assert not case(folder, "good").out.exists()


def test_a_flight_that_fails_says_why_and_keeps_its_folder(folder: Path):
    tried = fly_case(case(folder, "broken"))
    assert tried.verdict == "failed"
    assert any("`max(nano.state.altitude) < 1 cm` did not hold" in r for r in tried.reason)
    assert tried.folder is not None
    assert (tried.folder / "report.html").is_file()


def test_a_reason_is_told_without_the_tables_below_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    reason = f"preflight: nano: parameters: {detailed('2 are wrong', ['A is 0', 'B is 1'])}; more"

    def refused(plan, request, listeners) -> Flown:
        return Flown(request.out, {"outcome": "interrupted", "reason": reason, "expectations": []})

    monkeypatch.setattr(cases, "fly", refused)
    tried = fly_case(case(folder, "good"))
    assert tried.reason == ("preflight: nano: parameters: 2 are wrong; more",)


def test_an_invalid_mission_gives_its_findings(folder: Path):
    tried = fly_case(case(folder, "invalid"))
    assert tried.verdict == "invalid"
    assert "KYB" in tried.reason[0]


def test_a_library_is_no_mission(folder: Path):
    assert folder / "shared.yaml" not in list(missions_under([folder]))
    assert "is a library" in fly_case(case(folder, "shared")).reason[0]


@pytest.mark.thorough
def test_parallel_flights_are_those_of_one_process(folder: Path):
    cases = [case(folder, "good", seed) for seed in range(3)]
    alone, together = (run_cases(cases, jobs, lambda _: None) for jobs in (1, 2))
    assert [(t.case, t.verdict, t.taken) for t in alone] == [
        (t.case, t.verdict, t.taken) for t in together
    ]


def in_turn(case: FlightCase) -> FlightResult:
    """Seed 1 dies of what its mission's name says; the others succeed."""
    if case.seed == 1 and case.path.stem == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if case.seed == 1 and case.path.stem == "raised":
        raise ZeroDivisionError("of all things")
    return FlightResult(case, "succeeded")


def first_short(case: FlightCase) -> FlightResult:
    """Seed 0 succeeds after a hop; the others fly for long."""
    if case.seed:
        return fly_case(case)
    assert fly_case(replace(case, path=case.path.with_name("good.yaml"))).passed
    return FlightResult(case, "succeeded")


def stubborn(case: FlightCase) -> FlightResult:
    """Seed 0 succeeds at once; the others hear no signal and never end."""
    if case.seed:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        threading.Event().wait()
    return FlightResult(case, "succeeded")


def orphaned(case: FlightCase) -> FlightResult:
    """A long flight whose session is killed at its beginning."""
    os.kill(os.getppid(), signal.SIGKILL)
    return fly_case(case)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("killed", "the process that flew it died (SIGKILL)"),
        pytest.param(
            "raised", "kybflow failed: ZeroDivisionError: of all things", marks=pytest.mark.thorough
        ),
    ],
)
@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.thorough)])
def test_a_flight_that_takes_its_process_along_is_the_only_one_lost(
    folder: Path, name: str, reason: str, jobs: int
):
    cases = [case(folder, name, seed) for seed in range(4)]
    tried = run_cases(cases, jobs, lambda _: None, in_turn)
    assert [one.case for one in tried] == cases
    assert [one.case.seed for one in tried if not one.passed] == [1]
    assert (tried[1].verdict, tried[1].reason[0]) == ("driver_failed", reason)


@pytest.fixture
def long(folder: Path) -> Path:
    first, rest = GOOD.split("      up: ")
    _, expect = rest.split("expect:")
    states = """      up: {do: take_off, height: 50 cm, then: still}
      still: {do: hover, for_time: 240 s, then: down}
      down: {do: land}
expect:"""
    (folder / "long.yaml").write_text(first + states + expect)
    assert compile_mission(folder / "long.yaml", catalog=load_catalog()).plan is not None
    return folder


@pytest.mark.thorough
def test_an_interrupt_lands_what_flies_and_leaves_out_the_rest(long: Path):
    cases = [case(long, "long", seed) for seed in range(9)]
    told: list[FlightResult] = []

    def done(tried: FlightResult) -> None:
        told.append(tried)
        signal.raise_signal(signal.SIGTERM)

    tried = run_cases(cases, 2, done, first_short)
    assert [(one.case.seed, one.verdict, one.reason) for one in told] == [(0, "succeeded", ())]
    assert tried == told
    assert exit_code(tried, len(cases)) == 130


@pytest.mark.thorough
def test_a_second_interrupt_kills(folder: Path):
    cases = [case(folder, "good", seed) for seed in range(3)]
    told: list[FlightResult] = []

    def done(tried: FlightResult) -> None:
        told.append(tried)
        pool.interrupts = 2

    pool = Pool(2, done, stubborn)
    pool.run(cases)
    assert [one.case for one in told] == cases[:1]


@pytest.mark.thorough
def test_no_worker_outlives_its_session(long: Path):
    """The worker holds the output open: it is read to its end when the worker has ended."""
    code = (
        f"import sys; sys.path[:0] = {[str(HERE), str(HERE.parent / 'support')]!r}\n"
        "from pathlib import Path; from test_session import case, orphaned, run_cases\n"
        f"run_cases([case(Path({str(long)!r}), 'long')], 1, print, orphaned)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGKILL, "", "")


@pytest.mark.thorough
@pytest.mark.parametrize(
    "number",
    [
        n if n == signal.SIGINT else pytest.param(n, marks=pytest.mark.slow)
        for n in Interrupts.SIGNALS
        if n != signal.SIGTERM
    ],
)
def test_a_terminal_that_interrupts_ends_the_command(folder: Path, number: int):
    command = [sys.executable, "-m", "kybflow", "test", "broken.yaml", "--seeds", "0..99999"]
    with subprocess.Popen(
        [*command, "--junit", "junit.xml"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as child:
        assert child.stdout is not None
        first = child.stdout.readline()
        os.killpg(child.pid, number)
        rest = child.stdout.read()
    (suite,) = ElementTree.parse(folder / "junit.xml").getroot()
    assert first.startswith("FAILED  broken.yaml, seed ")
    assert f"stopped after {suite.get('tests')} of 100000 flights" in rest
    assert "Traceback" not in rest
    assert "INTERRUPTED" not in rest
    assert child.returncode == 130


@pytest.mark.parametrize(("option", "name"), [("--out", "file"), ("--junit", "none/junit.xml")])
def test_what_cannot_be_written_is_said_before_any_flight(folder: Path, option: str, name: str):
    (folder / "file").write_text("")
    done = ran(folder / "broken.yaml", "--out", folder / "runs", option, f"{folder}/{name}")
    assert done.exit_code == 2
    assert f"Invalid value for {option}" in done.output
    assert "FAILED" not in done.output


@pytest.mark.thorough
def test_names_are_told_as_they_are(folder: Path):
    (folder / "all:100:.yaml").write_text((folder / "broken.yaml").read_text())
    done = ran(str(folder / "all:100:.yaml"), "--out", str(folder / "runs"))
    assert "FAILED" in done.output
    assert done.output.count("all:100:.yaml") >= 2
    assert "\N{HUNDRED POINTS SYMBOL}" not in done.output


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        (["succeeded"], 0),
        (["succeeded", "failed"], 1),
        (["failed", "driver_failed"], 3),
        (["driver_failed", "invalid"], 2),
    ],
)
def test_the_exit_code_is_that_of_the_gravest(verdicts: list[str], code: int):
    tried = [FlightResult(FlightCase(Path("m"), 0, Path("r")), verdict) for verdict in verdicts]
    assert exit_code(tried, len(tried)) == code
    assert exit_code(tried, len(tried) + 1) == 130


def test_junit_tells_failures_from_errors(folder: Path, tmp_path: Path):
    cases = [FlightCase(Path("m.yaml"), seed, tmp_path) for seed in range(3)]
    verdicts = ("succeeded", "failed", "invalid")
    tried = [FlightResult(c, v, ("why\x00",)) for c, v in zip(cases, verdicts, strict=True)]
    write_junit(tmp_path / "junit.xml", tried)
    (suite,) = ElementTree.parse(tmp_path / "junit.xml").getroot()
    counts = {"tests": "3", "failures": "1", "errors": "1"}
    assert suite.attrib.items() >= {"name": "m.yaml", **counts}.items()
    assert suite[1][0].attrib == {"message": "why?", "type": "failed"}


@pytest.mark.thorough
def test_the_command_tells_what_was_not_taken_and_leaves_no_folder_that_holds_nothing(folder: Path):
    done = ran(str(folder / "good.yaml"), "--out", str(folder / "runs"))
    assert done.exit_code == 0
    assert "1 of 1" in done.output
    assert f"{folder / 'good.yaml'}:9: not taken: nano: still" in done.output
    assert list((folder / "runs").iterdir()) == []


def test_what_never_flew_has_nothing_to_tell_of_its_states(folder: Path):
    path = folder / "good.yaml"
    mission = compiled(path, warns=True)
    stuck = FlightResult(
        FlightCase(path, 0, folder), "driver_failed", items=tuple(coverage_items(mission))
    )
    assert coverage_of([stuck]) == {}
    taken = frozenset({StateItem("nano", "up")})
    flew = FlightResult(FlightCase(path, 1, folder), "failed", items=stuck.items, taken=taken)
    assert len(coverage_of([stuck, flew])[path].missed) == len(stuck.items) - 1


@pytest.mark.thorough
def test_full_fails_when_something_was_not_taken(folder: Path):
    assert ran(str(folder / "good.yaml"), "--full", "--out", str(folder)).exit_code == 1


@pytest.mark.thorough
def test_the_command_ends_as_its_gravest_case(folder: Path):
    done = ran(str(folder), "--out", str(folder / "runs"), "--jobs", "1")
    assert done.exit_code == 2
    assert "FAILED" in done.output
    assert "INVALID" in done.output


@pytest.mark.parametrize("seeds", ["x", "3..1", "1..", "", "-1"])
def test_seeds_that_are_none_are_refused(folder: Path, seeds: str):
    done = ran(str(folder), f"--seeds={seeds}")
    assert done.exit_code == 2
    assert "neither a seed" in done.output
