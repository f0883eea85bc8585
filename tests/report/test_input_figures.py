"""The figures of inputs: their axes, their buttons, and when they were lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_run import write_run
from test_page import unpacked

from kybflow.recording.run_folder import INPUTS, RunFolderError
from kybflow.report.data import read_run
from kybflow.report.figures import figures
from kybflow.report.page import render

TABLE = (
    "t, x, z, buttons, lost\n0, 0, 0, , \n2, 0.5, 0, go, \n3, 0.5, 0, go, \n4, , , , unplugged\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_run(tmp_path_factory.mktemp("run"), 6.0)
    (folder / INPUTS).mkdir()
    (folder / INPUTS / "stick.csv").write_text(TABLE, encoding="utf-8")
    (folder / INPUTS / "silent.csv").write_text(TABLE.splitlines()[0] + "\n", encoding="utf-8")
    return folder


def test_the_axes_are_steps_and_a_lost_input_is_a_band(folder: Path) -> None:
    [figure] = [f for f in figures(read_run(folder)) if f.name.startswith("input_")]
    assert figure.title == "Input stick"
    x, z = figure.traces
    assert (x["name"], z["name"]) == ("x", "z")
    time, drawn = (unpacked(x[way]) for way in "xy")
    assert pytest.approx([0.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 6.0], abs=0.01) == time
    nothing = [np.nan, np.nan]
    assert pytest.approx([0.0, 0.0, 0.5, 0.5, 0.5, 0.5, *nothing], nan_ok=True) == drawn
    [band] = figure.layout["shapes"]
    assert band["x0"] == 4.0
    assert band["label"]["text"] == "unplugged"
    assert "Buttons: go at 2.00 s." in figure.note
    assert "Input stick" in render(read_run(folder))


def test_an_unreadable_table_is_an_error(folder: Path) -> None:
    (folder / INPUTS / "torn.csv").write_text("t, x\n0, much\n", encoding="utf-8")
    with pytest.raises(RunFolderError, match="`x` must be a number"):
        read_run(folder)
    (folder / INPUTS / "torn.csv").unlink()
