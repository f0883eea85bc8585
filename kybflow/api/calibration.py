"""The files around a camera's calibration: recorded poses in, corrections of the mission out."""

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
    """Return whether frames belong to a run folder, which keeps only a few, scaled and drawn on."""
    return any((above / EVENTS).is_file() for above in (frames, *frames.resolve().parents))


def recorded_track(path: Path, vehicle: str) -> RecordedTrack:
    """Read the poses of a vehicle from a table or from a run folder. Raises FileError."""
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
    """Return the files to write into `folder`, by name: the corrected tag map, the lens, and the
    changes of the mission."""
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
