"""What motion capture said in a run is read back from its folder, however it ended."""

from __future__ import annotations

from pathlib import Path

import numpy
import pytest
from recorded_run import write_run

from kybflow.api.calibration import read_recorded_poses
from kybflow.recording.run_folder import LOG, RunFolderError


def test_poses_are_read_back(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", seconds=7.0, rate=50)
    rows = read_recorded_poses(run, "mk")
    assert rows.shape[1] == 8
    assert (numpy.diff(rows[:, 0]) > 0.0).all()
    assert rows[-1, 0] == pytest.approx(7.0, abs=0.1)
    assert rows[-1, 4:].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert len(read_recorded_poses(run, "nobody")) == 0


@pytest.mark.thorough
def test_of_a_killed_run_they_are_read_as_far_as_they_go(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", seconds=7.0, rate=50)
    whole = (run / LOG).read_bytes()
    rows = read_recorded_poses(run, "mk")
    for cut in (len(whole) * 3 // 4, *range(len(whole) - 300, len(whole))):
        (run / LOG).write_bytes(whole[:cut])
        found = read_recorded_poses(run, "mk")
        assert found.tolist() == rows[: len(found)].tolist()


def test_what_is_no_recording_is_told(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="is not a recording of a run"):
        read_recorded_poses(tmp_path, "mk")
    (tmp_path / LOG).write_text("none at all", encoding="utf-8")
    with pytest.raises(RunFolderError, match="is not a recording of a run"):
        read_recorded_poses(tmp_path, "mk")
