"""The command line: what it prints and how it ends."""

from __future__ import annotations

import errno
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from toolchain import ROOT, invoke

from kybflow.recording import run_folder

GOOD = str(ROOT / "missions" / "figure_eight.yaml")
FIRST = str(ROOT / "missions" / "first_flight.yaml")


def shell(command: str) -> subprocess.CompletedProcess[str]:
    words = ["bash", "-c", command]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)


def events_in(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]


@pytest.fixture
def bad(tmp_path: Path) -> str:
    path = tmp_path / "bad.yaml"
    path.write_text("kybflow: 1\nmission: m\nvehicels: {}\n")
    return str(path)


def test_validate_says_ok_and_ends_with_0() -> None:
    result = invoke("validate", GOOD, "--set", "lap=8s")
    assert result.exit_code == 0
    assert result.output.startswith(f"{GOOD}: ok (")


def test_validate_reports_and_ends_with_2(bad: str) -> None:
    result = invoke("validate", GOOD, bad, "--format", "text")
    assert result.exit_code == 2
    assert f"{bad}:3:1 error[KYB101]: `vehicels` is not a key of a mission" in result.output


def test_validate_speaks_json(bad: str) -> None:
    result = invoke("validate", GOOD, bad, "--format", "json")
    report = json.loads(result.output)
    assert (result.exit_code, report["valid"]) == (2, False)
    assert [file["valid"] for file in report["files"]] == [True, False]
    found = report["files"][1]["diagnostics"]
    assert [d["code"] for d in found] == ["KYB101"]
    assert {"file", "line", "column", "severity", "message", "help"} <= set(found[0])


def test_validate_takes_folders() -> None:
    result = invoke("validate", str(ROOT / "missions"), "--format", "json")
    paths = {Path(file["path"]).name for file in json.loads(result.output)["files"]}
    assert result.exit_code == 0
    assert {"figure_eight.yaml", "airframes.yaml"} <= paths


def test_parts_lists_and_explains() -> None:
    assert "figure_eight" in invoke("parts").output
    text = invoke("parts", "circle").output
    assert "radius" in text
    assert "above 0 m" in text


@pytest.mark.parametrize("arguments", [("parts", "circel"), ("validate",), ("fly",), ("run", "-x")])
def test_a_wrong_command_line_ends_with_2_and_no_traceback(arguments: tuple[str, ...]) -> None:
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert not isinstance(result.exception, Exception)


@pytest.mark.parametrize("words", [("validate",), ("schema", "--check"), ("run", FIRST, "--out")])
def test_a_path_at_which_nothing_can_be_is_refused(words: tuple[str, ...]) -> None:
    result = invoke(*words, "a" * 300)
    assert result.exit_code == 2
    assert f"`{'a' * 100}` can't be a path: File name too long" in result.output


def test_a_command_that_is_misspelt_gets_the_nearest() -> None:
    result = invoke("vaildate", GOOD)
    assert result.exit_code == 2
    assert "Did you mean 'validate'?" in result.output


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    path = tmp_path / "none" / "schema.json"
    result = invoke("schema", "--write", str(path))
    assert result.exit_code == 2
    assert "can't be written" in result.output


def test_schema_prints_writes_and_checks(tmp_path: Path) -> None:
    path = tmp_path / "schema.json"
    assert json.loads(invoke("schema").output)["title"] == "mission"
    assert invoke("schema", "--write", str(path)).exit_code == 0
    assert invoke("schema", "--check", str(path)).exit_code == 0
    path.write_text("{}")
    result = invoke("schema", "--check", str(path))
    assert result.exit_code == 2
    assert f"kybflow schema --write {path}" in result.output


def test_parts_ends_where_its_reader_does() -> None:
    """A closed pipe (`kybflow parts | head -1`) is no error worth a traceback."""
    program = f"{sys.executable} -c 'from kybflow.cli.app import main; main()'"
    assert shell(f"{program} parts | head -1").stderr == ""


PRINTS = [
    "parts", f"validate {GOOD}", "--help", "library", "explain", "schema", f"graph {GOOD}",
    f"show {GOOD}", f"validate {GOOD} --format json", f"preflight {GOOD}", "new mine", "--version",
]  # fmt: skip
QUICK, THOROUGH = 1, 5
"""How many of them are tried in every run of the tests, and how many in the thorough; each is a
process of its own. The others are slow."""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(
            words,
            marks=() if k < QUICK else pytest.mark.thorough if k < THOROUGH else pytest.mark.slow,
        )
        for k, words in enumerate(PRINTS)
    ],
)
def test_output_that_cannot_be_written_is_said_in_one_sentence(words: str, tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "kybflow", *words.split()],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            cwd=tmp_path,
        )
    assert done.returncode == 1
    assert done.stderr == "kybflow: the output can't be written: No space left on device\n"


@pytest.mark.thorough
@pytest.mark.parametrize("words", [["parts"], ["schema"]], ids=" ".join)
def test_an_output_that_was_closed_is_nobodys_concern(words: list[str]) -> None:
    done = shell(f"{sys.executable} -m kybflow {' '.join(words)} >&-")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "outlet", [pytest.param("| head -1", marks=pytest.mark.thorough), "> /dev/full"]
)
def test_a_flight_goes_on_when_nobody_can_be_told(tmp_path: Path, outlet: str) -> None:
    done = shell(f"{sys.executable} -m kybflow run {FIRST} --no-report --out {tmp_path} {outlet}")
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "succeeded"
    assert done.stderr == ""


def test_run_shows_values_as_the_report_does(tmp_path: Path) -> None:
    result = invoke("run", FIRST, "--out", str(tmp_path), "--set", "height=50cm")
    assert result.exit_code == 0
    assert "held    finished within 30 s  (" in result.output
    assert f"report: {tmp_path / 'report.html'}" in result.output


def test_an_unknown_option_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = invoke("run", FIRST, "--out", str(out), "--option", "nano.processor.fence.margin=1")
    assert result.exit_code == 2
    assert "did you mean `nano.processors.fence.margin`?" in result.output
    assert not out.exists()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("operator.go", "is not NAME@TIME"),
        ("@2s", "is not NAME@TIME"),
        ("operator.go@2 m", "`2 m` is a length, but a duration is needed"),
        ("operator.go@-1", "has a negative time"),
        ("operator.lnad@2s", "did you mean `operator.land`?"),
        ("nano.landed@2s", "the mission doesn't wait for `nano.landed`"),
    ],
)
def test_an_event_that_cannot_be_given_is_refused_before_anything_is_written(
    given: str, said: str, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    result = invoke("run", FIRST, "--out", str(out), "--emit", given)
    assert result.exit_code == 2
    assert said in " ".join(result.output.replace("│", " ").split())
    assert not out.exists()


def test_events_are_given_while_it_flies(tmp_path: Path) -> None:
    words = ("--emit", "operator.land@6s", "--emit", "operator.pause@ 5.4", "--no-report")
    result = invoke("run", FIRST, "--out", str(tmp_path), *words)
    told = events_in(tmp_path)
    given = [(e["event"], e["t_s"]) for e in told if e["event"].startswith("operator.")]
    assert given == [("operator.pause", 5.4), ("operator.land", 6.0)]
    assert result.exit_code in (0, 1)


def test_an_event_whose_time_never_came_is_told(tmp_path: Path) -> None:
    words = ("--emit", "operator.land@1s", "--emit", "operator.pause@9000s", "--no-report")
    result = invoke("run", FIRST, "--out", str(tmp_path), *words)
    assert (
        "`operator.pause` at 9000 s was never given, because the run ended first" in result.output
    )
    assert "`operator.land` at" not in result.output


def earlier(folder: Path, *events: str) -> Path:
    """The folder of an earlier run, as far as `--again` reads it."""
    folder.mkdir()
    asked = {"target": "sim", "seed": 3, "set": [], "option": [], "emit": ["operator.pause@2s"]}
    (folder / "provenance.json").write_text(json.dumps(asked))
    (folder / "events.jsonl").write_text("".join(f"{line}\n" for line in events) + '{"half')
    return folder


def command_given(seconds: float, **fields: object) -> str:
    return json.dumps({"t_s": seconds, "event": "command_given", "fields": fields})


def test_a_run_is_flown_again_with_the_commands_of_its_record(tmp_path: Path) -> None:
    run_before = earlier(
        tmp_path / "before",
        command_given(2.0, command="pause", by="command line", accepted=True),
        command_given(2.408, command="land", by="anna", heard_s=2.4, accepted=True),
    )
    words = ("--again", str(run_before), "--no-report", "--out", str(tmp_path / "run"))
    invoke("run", FIRST, *words)
    provenance = json.loads((tmp_path / "run" / "provenance.json").read_text())
    assert (provenance["seed"], provenance["emit"]) == (3, ["operator.pause@2.0s"])
    given = [e for e in events_in(tmp_path / "run") if e["event"] == "command_given"]
    assert [(e["t_s"], e["fields"]["command"], e["fields"]["by"]) for e in given] == [
        (2.0, "pause", "command line"),
        (2.4, "land", "anna"),
    ]


@pytest.mark.parametrize(
    ("events", "words", "said"),
    [
        ((), ("--seed", "4"), "--again takes target, seed, --set, --option and --emit from the"),
        (("[]",), (), "can't be repeated: `provenance.json` or `events.jsonl` is damaged"),
        ((command_given(1.0, command="fly", by="a"),), (), "there is no command `fly`"),
    ],
)
def test_what_cannot_be_flown_again_is_refused_before_anything_is_written(
    events: tuple[str, ...], words: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    run_before, out = earlier(tmp_path / "before", *events), tmp_path / "run"
    result = invoke("run", FIRST, "--again", str(run_before), "--out", str(out), *words)
    assert result.exit_code == 2
    assert said in " ".join(result.output.replace("│", " ").split())
    assert not out.exists()


def test_graph_draws_both_ways(tmp_path: Path) -> None:
    assert "stateDiagram-v2" in invoke("graph", FIRST).output
    drawing = tmp_path / "first.svg"
    assert invoke("graph", FIRST, "--format", "svg", "--out", str(drawing)).exit_code == 0
    assert drawing.read_text(encoding="utf-8").startswith("<svg")


@pytest.mark.parametrize("command", ["run", "show", "graph", "preflight"])
def test_a_library_is_told_to_be_no_mission(command: str) -> None:
    library = ROOT / "missions" / "library" / "airframes.yaml"
    result = invoke(command, str(library))
    assert result.exit_code == 2
    assert f"{library} is a library, not a mission" in result.output


def test_the_version_needs_no_command() -> None:
    result = invoke("--version")
    assert result.exit_code == 0
    assert result.output.startswith("kybflow ")


@pytest.mark.parametrize("command", ["run", "test", "preflight", "validate"])
def test_help_gives_each_exit_code_and_example_a_line(command: str) -> None:
    lines = [line.strip() for line in invoke(command, "--help").output.splitlines()]
    assert any(line.startswith("0: ") for line in lines)
    assert any(line.startswith("2: ") for line in lines)
    assert sum(line.startswith(f"kybflow {command} ") for line in lines) >= 2
    assert "  |  " not in " ".join(lines)


@pytest.mark.parametrize(
    "arguments",
    [
        "validate missions/*.yaml",
        pytest.param(f"test {FIRST} --seeds 0..1", marks=pytest.mark.thorough),
    ],
)
def test_a_reader_that_goes_away_changes_no_exit_code(tmp_path: Path, arguments: str) -> None:
    out = f" --out {tmp_path}" if arguments.startswith("test") else ""
    command = f"{sys.executable} -m kybflow {arguments}{out} | head -0; echo ${{PIPESTATUS[0]}}"
    done = shell(command)
    assert (done.stdout, done.stderr) == ("0\n", "")


def test_run_tells_names_as_they_are(tmp_path: Path) -> None:
    mission = tmp_path / "a:100:.yaml"
    mission.write_text(MINE, encoding="utf-8")
    result = invoke("run", str(mission), "--out", str(tmp_path / "run"), "--no-report")
    assert result.exit_code == 0
    assert f"[{mission}:8]" in result.output


MINE = """kybflow: 1
mission: hop
import: {std: kybflow/airframes}
vehicles:
  nano:
    like: std.nano_plus
    behaviors:
      up: {do: take_off, height: 50 cm, then: down}
      down: {do: land}
"""


def test_an_earlier_run_is_not_replaced(tmp_path: Path) -> None:
    words = ("run", FIRST, "--out", str(tmp_path), "--no-report")
    assert invoke(*words).exit_code == 0
    summary = (tmp_path / "summary.json").read_bytes()
    again = invoke(*words)
    assert again.exit_code == 2
    assert "contains an earlier run; name another folder, or remove it" in again.output
    assert (tmp_path / "summary.json").read_bytes() == summary


def test_a_disk_that_is_full_at_the_end_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = run_folder.write_file

    def full(path: Path, text: str) -> None:
        if path.name == run_folder.SUMMARY:
            raise run_folder.RunUnwritten(f"`{path}` can't be written: No space left on device")
        write(path, text)

    monkeypatch.setattr(run_folder, "write_file", full)
    result = invoke("run", FIRST, "--out", str(tmp_path))
    assert result.exit_code == 1
    assert "first_flight FAILED: `" in result.output
    assert "can't be written: No space left on device" in result.output
    assert "run_ended" in (tmp_path / "events.jsonl").read_text()


def test_a_disk_that_is_full_before_take_off_is_no_mistake_of_the_mission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(run_folder, "write_whole", full)
    result = invoke("run", FIRST, "--out", str(tmp_path))
    assert result.exit_code == 1
    assert result.output.endswith("can't be written: No space left on device\n")


def test_show_tells_groups_flows_callbacks_faults_and_world() -> None:
    formation = invoke("show", str(ROOT / "missions" / "formation.yaml")).output
    assert "world\n  fence from [-3, -3, 0] m to [3, 3, 2.5] m\n" in formation
    assert "groups\n  swarm: a, b, c, d\n" in formation
    assert "flow solo (drives given vehicles; begins with leave)\n" in formation
    assert "others: turn; give d to solo (event solo.finished: again)\n" in formation
    steered = invoke("show", str(ROOT / "missions" / "joystick.yaml")).output
    assert "stick: script (a is take; b is give; y is land; dead man: right_shoulder)" in steered
    lives = invoke("show", str(ROOT / "missions" / "two_lives.yaml")).output
    assert "callbacks\n  sick.fault_injected: log `{vehicle} suffers {fault}" in lives
    assert "faults\n  battery_sag on sick, when behavior == eight and elapsed > 4 s\n" in lives
