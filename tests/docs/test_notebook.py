"""The notebook of the examples runs from its first cell to its last, and is short."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import nbformat
import polars
import pytest
from nbclient import NotebookClient
from toolchain import ROOT, with_library

NOTEBOOK = ROOT / "examples" / "analyse.ipynb"


def test_it_is_committed_without_outputs_and_analyses_in_ten_lines() -> None:
    cells = [cell for cell in nbformat.read(NOTEBOOK, 4).cells if cell.cell_type == "code"]
    assert [cell.outputs for cell in cells] == [[], []]
    assert len([line for line in cells[-1].source.splitlines() if line]) <= 10


@pytest.mark.thorough
def test_it_runs(tmp_path: Path) -> None:
    shutil.copy(ROOT / "missions" / "figure_eight.yaml", with_library(tmp_path / "missions"))
    examples = tmp_path / "examples"
    examples.mkdir()
    notebook = nbformat.read(NOTEBOOK, 4)
    NotebookClient(notebook, resources={"metadata": {"path": str(examples)}}).execute()
    _, fly, _, look = notebook.cells
    assert "<td>succeeded</td>" in fly.outputs[0].data["text/html"]
    said, shown = look.outputs
    assert re.fullmatch(r"0\.0\d\d m at \S+ s in `(steady|eight)`\n", said.text)
    assert shown.data["image/png"]
    [table] = examples.glob("runs/*/both.parquet")
    assert set(polars.read_parquet(table)["vehicle"]) == {"mk", "nano"}
