"""The poses of a body that a run recorded, as they were measured."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader
from numpy.typing import NDArray

from kybflow.core.signals import NS, Pose
from kybflow.recording.layout import dtype_spec
from kybflow.recording.run_folder import LOG, RunFolderError


def read_recorded_poses(folder: Path, vehicle: str) -> NDArray[numpy.float64]:
    """What motion capture said of a vehicle, in order of time: rows of time in seconds, position,
    attitude, (n, 8). Raises RunFolderError for a folder without a recording."""
    topic, found = f"/{vehicle}/pose", []
    path = folder / LOG
    try:
        with path.open("rb") as file:
            reader = NonSeekingReader(file)
            try:
                for _, _, message in reader.iter_messages([topic], log_time_order=False):
                    found.append(message.data)
            except (EndOfFile, struct.error):
                pass  # the run was killed, or is still going on
    except (OSError, McapError) as error:
        raise RunFolderError(f"`{path}` is no recording of a run: {error}") from error
    poses = numpy.frombuffer(b"".join(found), numpy.dtype(dtype_spec(Pose)))
    rows = numpy.column_stack((poses["time"] / NS, poses["position"], poses["attitude"]))
    kept: NDArray[numpy.float64] = rows[numpy.unique(rows[:, 0], return_index=True)[1]]
    return kept
