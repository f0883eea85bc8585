"""What an install without the extras can't do is told with the command that brings it."""

import subprocess
import sys
from pathlib import Path

import pytest
from toolchain import MISSIONS

WITHOUT = """
import sys
sys.modules["pymavlink"] = sys.modules["rotorpy"] = None
from kybflow.__main__ import main
sys.argv = ["kybflow", *sys.argv[1:]]
main()
"""


MAVLINK = "MAVLink needs pymavlink: pip install 'kybflow[mavlink]'"
ROTORPY = "this driver needs rotorpy: pip install 'kybflow[rotorpy]'"


@pytest.mark.parametrize(
    ("target", "answer"),
    [
        pytest.param("emulated_px4", MAVLINK, marks=pytest.mark.thorough),
        ("px4", MAVLINK),
        pytest.param("rotorpy", ROTORPY, marks=pytest.mark.thorough),
    ],
)
def test_a_target_that_needs_an_extra_says_what_to_install(
    target: str, answer: str, tmp_path: Path
) -> None:
    mission = str(MISSIONS / "first_flight.yaml")
    command = ["run", mission, "--target", target, "--plain", "--out", str(tmp_path / "run")]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, *command], capture_output=True, text=True, check=False
    )
    said = done.stdout + done.stderr
    assert answer in said
    assert "Traceback" not in said
    assert done.returncode != 0
