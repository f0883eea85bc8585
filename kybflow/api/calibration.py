"""A camera's calibration from a walk over tags: what is known of the walk, and what it changes in
the mission."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy

from kybflow.core.errors import FileError
from kybflow.dsl.calibration_file import write_calibration
from kybflow.dsl.expanding.vehicles import written_camera
from kybflow.dsl.plan import Plan
from kybflow.recording.recorded_poses import read_recorded_poses
from kybflow.recording.run_folder import EVENTS, RunFolderError
from kybflow.vision.calibration.pose_table import read_poses
from kybflow.vision.calibration.track import RecordedTrack
from kybflow.vision.tag_table import write_tags

if TYPE_CHECKING:
    from kybflow.vision.calibration.walk import WalkCalibration


def is_of_a_run(frames: Path) -> bool:
    """Whether frames are of a run's folder, which has few, made smaller and drawn over."""
    return any((above / EVENTS).is_file() for above in (frames, *frames.resolve().parents))


def recorded_track(path: Path, vehicle: str) -> RecordedTrack:
    """Where the body of a vehicle was, from a table of poses or from the folder of a run. Raises
    FileError."""
    try:
        if path.is_dir():
            rows = read_recorded_poses(path, vehicle)
        else:
            found = read_poses(path.read_text(encoding="utf-8-sig"))
            rows = numpy.array([(one.time, *one.position, *one.attitude) for one in found])
    except FileError as error:
        where = f"{path}:{error.line}" if error.line else f"{path}"
        raise FileError(f"{where}: {error}" + (f"; {error.hint}" if error.hint else "")) from None
    except (OSError, UnicodeDecodeError, RunFolderError) as error:
        raise FileError(f"`{path}` can't be read: {error}") from None
    if len(rows) < 2:
        raise FileError(f"`{path}` has no poses of `{vehicle}`")
    return RecordedTrack(rows[:, 0], rows[:, 1:4], rows[:, 4:])


def corrections(plan: Plan, found: WalkCalibration, folder: Path, mission: Path) -> dict[str, str]:
    """The corrected map, the lens, and what to change in the mission: the texts of the files that
    `folder` gets, by name."""
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
