"""`kybflow rehearse`, and the rehearsal before `run` and in `preflight`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from toolchain import MISSIONS, invoke

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink import Mavlink

FIRST = str(MISSIONS / "first_flight.yaml")
WAITS = """\
kybflow: 1
mission: waits
import: {std: kybflow/airframes}
world:
  fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}
time_limit: 20 s
parameters:
  limit: {type: duration, default: 15 s}
vehicles:
  nano:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: hold, within: $limit}
      hold: {do: hover, next: [{event: operator.down, go: down}]}
      down: {do: land}
"""


@pytest.fixture
def mission(tmp_path: Path) -> str:
    path = tmp_path / "waits.yaml"
    path.write_text(WAITS)
    return str(path)


def test_it_tells_its_figures_and_what_it_assumed(mission: str) -> None:
    done = invoke("rehearse", mission)

    assert done.exit_code == 0
    assert "assumed: a person gives `operator.down` at " in done.output
    assert ", for which `hold` of `nano` waits\n" in done.output
    assert "\nwaits rehearsed: " in done.output
    assert "battery of `nano` " in done.output


def test_a_finding_ends_with_1_and_a_wrong_command_line_with_2(mission: str) -> None:
    late = invoke("rehearse", mission, "--emit", "operator.down@60s")
    tight = invoke("rehearse", mission, "--set", "limit=4.7s")
    wrong = invoke("rehearse", mission, "--emit", "operator.up@1s")

    assert (late.exit_code, tight.exit_code, wrong.exit_code) == (1, 1, 2)
    assert "error[KYB477]: the mission is not over after 20 s: `nano` is still in `hold`" in (
        late.output
    )
    assert "waits for the event `operator.down`" in late.output
    assert "error[KYB476]: `up` of `nano` is not done within its limit of 4.7 s" in tight.output
    assert "doesn't wait for `operator.up`" in wrong.output


def test_it_speaks_json(mission: str) -> None:
    report = json.loads(
        invoke("rehearse", mission, "--format", "json", "--set", "limit=4.7s").output
    )

    assert (report["mission"], report["clean"]) == ("waits", False)
    assert [d["code"] for d in report["diagnostics"]] == ["KYB476"]
    assert report["diagnostics"][0]["line"] == 14
    assert report["duration_s"] > 4.7
    assert report["battery"]["vehicle"] == "nano"


@pytest.mark.parametrize("form", ["sarif", "github"])
def test_it_speaks_to_reviews(mission: str, form: str) -> None:
    assert "KYB476" in invoke("rehearse", mission, "--format", form, "--set", "limit=4.7s").output


class Opened(Exception):
    """A driver was opened."""


def test_hardware_is_not_opened_when_its_rehearsal_goes_wrong(
    mission: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[int] = []

    def opens(*_: object) -> None:
        opened.append(1)
        raise DriverError("there is none")

    monkeypatch.setattr(Mavlink, "open", opens)
    words = ["run", mission, "--target", "px4", "--no-report", "--plain"]
    out = [str(tmp_path / name) for name in "abc"]

    stopped = invoke(*words, "--out", out[0], "--set", "limit=4.7s")
    assert (stopped.exit_code, opened) == (2, [])
    assert "error[KYB476]" in stopped.output
    assert not Path(out[0]).exists()

    refused = invoke(*words, "--out", out[1], "--set", "limit=4.7s", "--no-rehearsal")
    assert (refused.exit_code, opened) == (3, [1])
    assert "rehearsal_skipped" in refused.output

    clean = invoke(*words, "--out", out[2])
    assert (clean.exit_code, opened) == (3, [1, 1])
    assert "waits rehearsed: " in clean.output
    assert "rehearsal_skipped" not in clean.output


def test_a_simulation_is_rehearsed_when_asked(mission: str, tmp_path: Path) -> None:
    words = ["run", mission, "--no-report", "--plain", "--set", "limit=4.7s"]

    asked = invoke(*words, "--rehearse", "--out", str(tmp_path / "a"))

    assert asked.exit_code == 2
    assert "nothing has armed" in asked.output


def test_the_preflight_has_a_line_of_it(mission: str) -> None:
    good, bad = invoke("preflight", mission), invoke("preflight", mission, "--set", "limit=4.7s")

    assert (good.exit_code, bad.exit_code) == (0, 1)
    assert "green  all   rehearsal    " in good.output
    assert (
        "RED    all   rehearsal    `up` of `nano` is not done within its limit of 4.7 s"
        in bad.output
    )


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["first_flight", "formation"])
def test_it_needs_no_simulator(name: str) -> None:
    code = f"""
import sys
from kybflow.cli.app import main
sys.argv = ["kybflow", "rehearse", {str(MISSIONS / f"{name}.yaml")!r}]
try: main()
except SystemExit: pass
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    modules = set(done.stdout.splitlines()[-1].split())
    assert "kybflow.drivers.kinematic.world" in modules
    assert modules & {"mujoco", "scipy", "foxglove", "plotly", "jinja2"} == set()
