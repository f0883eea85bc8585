"""Scripts that use `import kybflow` are typed under pyright too, in its strict mode."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from pages import blocks, page
from toolchain import ROOT

pytest.importorskip("pyright", reason="needs pyright[nodejs]")

SCRIPT = """\
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import kybflow


def told(event: kybflow.Event) -> None:
    print(event.time, event.name, event.fields)


findings = kybflow.validate("mission.yaml")
assert_type(findings.valid, bool)
assert_type([one for one in findings], list[kybflow.Diagnostic])
run = kybflow.run("mission.yaml", set={"lap": "8 s"}, on_event=told)
assert_type(run, kybflow.Run)
assert_type(run.events, tuple[kybflow.Event, ...])
nano = run.vehicle("nano")
assert_type(nano, kybflow.RecordedVehicle)
assert_type(nano.error, NDArray[np.float64])
assert_type(nano.units, dict[str, str])
print(nano.state[np.nanargmax(nano.error)], nano["truth.position"][:, 0], nano.sensor("imu").time)
with kybflow.connect() as client:
    assert_type(client, kybflow.RunClient)
    client.switch("nano", "hold", for_time="10 s")
try:
    kybflow.rehearse("mission.yaml")
except kybflow.MissionInvalid as error:
    assert_type(error.findings, kybflow.Findings)
except (kybflow.CommandRefused, kybflow.KybflowError) as error:
    print(error)
"""


@pytest.mark.thorough
def test_scripts_are_typed(tmp_path: Path) -> None:
    (tmp_path / "strict.py").write_text(f"# pyright: strict\n{SCRIPT}")
    (tmp_path / "page.py").write_text("\n".join(blocks(page("docs/python.md"), "python")))
    (tmp_path / "pyrightconfig.json").write_text(f'{{"extraPaths": ["{ROOT}"]}}')
    words = ["-m", "pyright", "--pythonpath", sys.executable, "--project", str(tmp_path)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert "0 errors, 0 warnings" in done.stdout, done.stdout + done.stderr
