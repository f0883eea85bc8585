"""The scripts of the page about Python run one after the other, and its commands read the run."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from pages import page
from toolchain import with_library

PAGE = page("docs/python.md")


@pytest.mark.thorough
def test_the_scripts_and_the_commands_run(tmp_path: Path) -> None:
    missions = with_library(tmp_path / "missions")
    (missions / "figure_eight.yaml").write_text(page("missions/figure_eight.yaml"))
    script = "\n".join(re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL))
    said = subprocess.check_output([sys.executable, "-c", script], cwd=tmp_path, text=True)
    assert said.startswith("succeeded 0.0")
    assert "specific" not in said
    assert "error[KYB" in said
    [folder, *_] = sorted((tmp_path / "runs").iterdir())
    for line in re.findall(r"^    kybflow ((?:export|figure) .*?)(?:  #.*)?$", PAGE, re.MULTILINE):
        words = line.replace("runs/figure_eight-1", str(folder)).split()
        subprocess.run([sys.executable, "-m", "kybflow", *words], check=True, cwd=tmp_path)
    assert (folder / "error.pdf").is_file()
    assert (folder / "export-parquet" / "mk.parquet").is_file()
    assert (folder / "export-csv" / "nano.imu.csv").is_file()
