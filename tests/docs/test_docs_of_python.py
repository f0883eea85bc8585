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
    first, second, *_ = sorted((tmp_path / "runs").iterdir())
    flown = {"runs/figure_eight-1": str(first), "runs/figure_eight-2": str(second)}
    for line in re.findall(r"^    kybflow (.*?)(?:  #.*)?$", PAGE, re.MULTILINE):
        words = [flown.get(word, word) for word in line.split()]
        subprocess.run([sys.executable, "-m", "kybflow", *words], check=True, cwd=tmp_path)
    assert (first / "error.pdf").is_file()
    assert (tmp_path / "comparison.html").is_file()
    assert (first / "export-parquet" / "mk.parquet").is_file()
    assert (first / "export-csv" / "nano.imu.csv").is_file()
