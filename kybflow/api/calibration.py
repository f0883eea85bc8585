"""The files of a camera's calibration: reads the recorded poses, and formats the corrections of the
mission."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy
from mcap.exceptions import McapError
from numpy.typing import NDArray

from kybflow.core.errors import FileError
from kybflow.core.files import read_all
from kybflow.core.signals import NS, Pose
from kybflow.dsl.calibration_file import write_calibration
from kybflow.dsl.expanding.vehicles import written_camera
from kybflow.dsl.plan import Plan
from kybflow.recording.layout import dtype_spec
from kybflow.recording.messages import read_recording
from kybflow.recording.run_folder import EVENTS, LOG, RunFolderError
from kybflow.vision.calibration.track import RecordedTrack, read_poses
from kybflow.vision.tags import write_tags

if TYPE_CHECKING:
    from kybflow.vision.calibration.walk import WalkCalibration


def read_recorded_poses(folder: Path, vehicle: str) -> NDArray[numpy.float64]:
    """Return a vehicle's motion-capture poses from a run folder, shape (n, 8), in order of time. A
    row holds the time in seconds, the position and the attitude. Raises RunFolderError if the
    folder has no recording."""
    path = folder / LOG
    try:
        poses = (
            read_recording(path)[f"/{vehicle}/pose"].decoded(numpy.dtype(dtype_spec(Pose))).values
        )
    except (OSError, ValueError, McapError) as error:
        raise RunFolderError(f"`{path}` is not a recording of a run: {error}") from error
    rows = numpy.column_stack((poses["time"] / NS, poses["position"], poses["attitude"]))
    kept: NDArray[numpy.float64] = rows[numpy.unique(rows[:, 0], return_index=True)[1]]
    return kept


def is_of_a_run(frames: Path) -> bool:
    """Return whether the folder `frames` is part of a run folder. Such frames are unfit for a
    calibration: they are few, scaled down and drawn on."""
    return any((above / EVENTS).is_file() for above in (frames, *frames.resolve().parents))


def recorded_track(path: Path, vehicle: str) -> RecordedTrack:
    """Read a vehicle's poses from a pose table or a run folder. Raises FileError."""
    try:
        if not path.is_dir():
            return read_poses(read_all(path).decode("utf-8-sig"))
        rows = read_recorded_poses(path, vehicle)
    except FileError as error:
        where = f"{path}:{error.line}" if error.line else f"{path}"
        raise FileError(f"{where}: {error}" + (f"; {error.hint}" if error.hint else "")) from None
    except OSError as error:
        raise FileError(f"`{path}` can't be read: {error.strerror}") from None
    except (UnicodeDecodeError, RunFolderError) as error:
        raise FileError(f"`{path}` can't be read: {error}") from None
    if len(rows) < 2:
        raise FileError(f"`{path}` has no poses of `{vehicle}`")
    return RecordedTrack(rows[:, 0], rows[:, 1:4], rows[:, 4:])


def corrections(plan: Plan, found: WalkCalibration, folder: Path, mission: Path) -> dict[str, str]:
    """Return the contents of the files to write into `folder`, by file name: the corrected tag map,
    the lens, and the keys to change in the mission."""
    tags, lens = "tags.csv", f"{found.camera.name}.yaml"
    place = os.path.relpath(folder, mission.parent)
    corrected = {tag.key: tag for tag in found.tags}
    return {
        tags: write_tags(corrected.get(tag.key, tag) for tag in plan.tags),
        lens: write_calibration(found.camera.lens),
        "changes.yaml": "# For the mission, in place of what it has.\n"
        f"world:\n  tags:\n    floor: {{file: {place}/{tags}}}\n"
        f"airframe:\n  cameras:\n    {written_camera(found.camera, f'{place}/{lens}')}\n",
    }
