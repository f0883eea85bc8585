"""`kybflow test`: missions flown as tests, in one process and in several."""

from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from kybflow.cli import app
from kybflow.testing.cases import Case, Tried, try_case
from kybflow.testing.finding import missions_under
from kybflow.testing.junit import write_junit
from kybflow.testing.session import exit_code, run_cases

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


def case(folder: Path, name: str, seed: int = 0) -> Case:
    return Case(folder / f"{name}.yaml", seed, folder / "runs" / f"{name}-{seed}")


def ran(*arguments: str):
    return CliRunner().invoke(app, ["test", *arguments])


def test_a_flight_that_succeeds_leaves_no_folder(folder: Path):
    tried = try_case(case(folder, "good"))
    assert tried.passed
    assert tried.folder is None
    assert not case(folder, "good").out.exists()


def test_a_flight_that_fails_says_why_and_keeps_its_folder(folder: Path):
    tried = try_case(case(folder, "broken"))
    assert tried.verdict == "failed"
    assert any("`max(nano.state.altitude) < 1 cm` did not hold" in r for r in tried.reason)
    assert tried.folder is not None
    assert (tried.folder / "report.html").is_file()


def test_an_invalid_mission_gives_its_findings(folder: Path):
    tried = try_case(case(folder, "invalid"))
    assert tried.verdict == "invalid"
    assert "KYB" in tried.reason[0]


def test_a_library_is_no_mission(folder: Path):
    assert folder / "shared.yaml" not in list(missions_under([folder]))
    assert "is a library" in try_case(case(folder, "shared")).reason[0]


def test_parallel_flights_are_those_of_one_process(folder: Path):
    cases = [case(folder, "good", seed) for seed in range(3)]
    alone, together = (run_cases(cases, jobs, lambda _: None) for jobs in (1, 2))
    assert [(t.case, t.verdict, t.taken) for t in alone] == [
        (t.case, t.verdict, t.taken) for t in together
    ]


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        (["succeeded"], 0),
        (["succeeded", "failed"], 1),
        (["failed", "driver_failed"], 3),
        (["driver_failed", "invalid"], 2),
        (["invalid", "interrupted"], 130),
    ],
)
def test_the_exit_code_is_that_of_the_gravest(verdicts: list[str], code: int):
    tried = [Tried(Case(Path("m"), 0, Path("r")), verdict) for verdict in verdicts]
    assert exit_code(tried) == code


def test_junit_tells_failures_from_errors(folder: Path, tmp_path: Path):
    cases = [Case(Path("m.yaml"), seed, tmp_path) for seed in range(3)]
    verdicts = ("succeeded", "failed", "invalid")
    tried = [Tried(c, v, ("why\x00",)) for c, v in zip(cases, verdicts, strict=True)]
    write_junit(tmp_path / "junit.xml", tried)
    (suite,) = ElementTree.parse(tmp_path / "junit.xml").getroot()
    assert {k: suite.attrib[k] for k in ("name", "tests", "failures", "errors")} == {
        "name": "m.yaml",
        "tests": "3",
        "failures": "1",
        "errors": "1",
    }
    assert suite[1][0].attrib == {"message": "why?", "type": "failed"}


def test_the_command_tells_what_was_not_taken(folder: Path):
    done = ran(str(folder / "good.yaml"), "--out", str(folder / "runs"))
    assert done.exit_code == 0
    assert "1 of 1" in done.output
    assert f"{folder / 'good.yaml'}:9: not taken: nano: still" in done.output


def test_full_fails_when_something_was_not_taken(folder: Path):
    assert ran(str(folder / "good.yaml"), "--full", "--out", str(folder)).exit_code == 1


def test_the_command_ends_as_its_gravest_case(folder: Path):
    done = ran(str(folder), "--out", str(folder / "runs"), "--jobs", "1")
    assert done.exit_code == 2
    assert "FAILED" in done.output
    assert "INVALID" in done.output


@pytest.mark.parametrize("seeds", ["x", "3..1", "1..", "", "-1"])
def test_seeds_that_are_none_are_refused(folder: Path, seeds: str):
    done = ran(str(folder), f"--seeds={seeds}")
    assert done.exit_code == 2
    assert "no seed" in done.output
