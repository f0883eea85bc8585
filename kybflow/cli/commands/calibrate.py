"""`kybflow calibrate`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    compiled,
    examples,
    set_option,
    target_option,
    write,
)
from kybflow.cli.output import echo
from kybflow.core.exit_codes import FAILED
from kybflow.core.text import did_you_mean
from kybflow.vision import WAY_OUT

if TYPE_CHECKING:
    from kybflow.dsl.plan import Plan, VehiclePlan
    from kybflow.vision.calibration.track import RecordedTrack
    from kybflow.vision.calibration.walk import Standing, WalkCalibration
    from kybflow.world.cameras import Camera

EXAMPLES = examples(
    "kybflow calibrate floor.yaml --frames walk.avi",
    "kybflow calibrate floor.yaml --frames walk.avi --standing --write lab",
    "kybflow calibrate floor.yaml --frames walk/ --poses walk.csv --write lab",
)
TAGS, CHANGES = "tags.csv", "changes.yaml"
"""What is written, beside a file of the lens."""


@click.command("calibrate", cls=Subcommand, epilog=EXAMPLES)
@argument(
    "mission", "A mission with the tags and the camera as they are believed to be.", type=PATH
)
@click.option(
    "--frames", type=PATH, required=True, help="A video of the walk, or a folder of images."
)
@click.option(
    "--poses", type=PATH, help="Where the body was meanwhile: a table, or the folder of a run."
)
@click.option("--standing", is_flag=True, help="The first frame shows the vehicle on its start.")
@click.option("--vehicle", help="Which vehicle's camera it is.")
@click.option("--camera", help="Which of its cameras it is.")
@click.option("--write", "folder", type=PATH, help="The folder for the corrected map and camera.")
@target_option
@set_option
def command(
    mission: Path,
    frames: Path,
    poses: Path | None,
    standing: bool,
    vehicle: str | None,
    camera: str | None,
    folder: Path | None,
    target: str | None,
    sets: tuple[str, ...],
) -> None:
    """Find what is wrong with lens, mount and map from frames of a walk over the tags.

    \b
    Exit codes:
    0: it found the corrections.
    1: the frames tell none.
    2: the mission is invalid, or a file can't be read.
    """
    plan, _ = compiled(mission, target, sets)
    whose = _vehicle(plan, vehicle)
    lens = _camera(whose, camera)
    if poses is not None and standing:
        raise click.BadParameter("say where the body was once: --poses, or --standing")
    if not len(plan.tags):
        message = f"`{mission}` has no tags; they stand in `world: {{tags: ...}}`"
        raise click.BadParameter(message, param_hint="MISSION")
    _check_frames(frames)
    known = _standing(whose) if standing else None if poses is None else _track(poses, whose.name)
    found = _calibrated(plan, lens, frames, known)
    if folder is not None:
        _write(folder, plan, found, mission)


def _calibrated(
    plan: Plan, camera: Camera, frames: Path, known: RecordedTrack | Standing | None
) -> WalkCalibration:
    try:
        from kybflow.vision.calibration.frames import recorded
        from kybflow.vision.calibration.walk import MOST, calibrated
    except ImportError as error:
        raise click.BadParameter(f"frames need OpenCV ({error}); {WAY_OUT}") from None
    from kybflow.cli.printing.calibration import calibration_lines
    from kybflow.core.errors import CalibrationFailed, DriverError

    try:
        recording = recorded(frames, camera, MOST)
        found = calibrated(recording.frames, camera, plan.tags, known)
    except (CalibrationFailed, DriverError) as error:
        echo(f"error: {error}", err=True)
        raise Exit(FAILED) from None
    echo("\n".join(calibration_lines(found, len(recording.frames), recording.total)))
    return found


def _vehicle(plan: Plan, name: str | None) -> VehiclePlan:
    """The vehicle of that name, or the only one that has a camera."""
    vehicles = {own.name: own for own in plan.vehicles if own.cameras}
    if not vehicles:
        message = f"no vehicle of `{plan.mission}` has a camera"
        raise click.BadParameter(message, param_hint="MISSION")
    return vehicles[_chosen(name, list(vehicles), "vehicle with a camera", "--vehicle")]


def _camera(vehicle: VehiclePlan, name: str | None) -> Camera:
    return vehicle.cameras[_chosen(name, list(vehicle.cameras), "camera", "--camera")]


def _chosen(name: str | None, known: list[str], what: str, option: str) -> str:
    """One of the names that are known; the only one where none is said."""
    if name in known:
        return name
    if name is not None:
        message = f"there is no {what} `{name}`; {did_you_mean(name, known)}"
        raise click.BadParameter(message, param_hint=option)
    if len(known) > 1:
        names = ", ".join(f"`{one}`" for one in known)
        raise click.BadParameter(f"say which: {names}", param_hint=option)
    return known[0]


def _check_frames(path: Path) -> None:
    from kybflow.recording.run_folder import EVENTS

    if not path.exists():
        message = f"`{path}` is not there; it is a video, or a folder of images"
        raise click.BadParameter(message, param_hint="--frames")
    if any((above / EVENTS).is_file() for above in (path, *path.resolve().parents)):
        raise click.BadParameter(
            f"`{path}` is of a run, whose few frames are made smaller and drawn over for people;"
            " record a video",
            param_hint="--frames",
        )


def _standing(vehicle: VehiclePlan) -> Standing:
    from kybflow.vision.calibration.walk import Standing

    return Standing(vehicle.start, vehicle.heading)


def _track(path: Path, vehicle: str) -> RecordedTrack:
    import numpy

    from kybflow.core.errors import FileError
    from kybflow.dsl.reading.pose_table import read_poses
    from kybflow.recording.recorded_poses import read_recorded_poses
    from kybflow.recording.run_folder import RunFolderError
    from kybflow.vision.calibration.track import RecordedTrack

    try:
        if path.is_dir():
            rows = read_recorded_poses(path, vehicle)
        else:
            found = read_poses(path.read_text(encoding="utf-8-sig"))
            rows = numpy.array([(one.time, *one.position, *one.attitude) for one in found])
    except FileError as error:
        where = f"{path}:{error.line}" if error.line else f"{path}"
        message = f"{where}: {error}" + (f"; {error.hint}" if error.hint else "")
        raise click.BadParameter(message, param_hint="--poses") from None
    except (OSError, UnicodeDecodeError, RunFolderError) as error:
        message = f"`{path}` can't be read: {error}"
        raise click.BadParameter(message, param_hint="--poses") from None
    if len(rows) < 2:
        message = f"`{path}` has no poses of `{vehicle}`"
        raise click.BadParameter(message, param_hint="--poses")
    return RecordedTrack(rows[:, 0], rows[:, 1:4], rows[:, 4:])


def _write(folder: Path, plan: Plan, found: WalkCalibration, mission: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"`{folder}` can't be written: {error.strerror}"
        raise click.BadParameter(message, param_hint="--write") from None
    for name, text in _files(plan, found, os.path.relpath(folder, mission.parent)):
        write(folder / name, text, "--write")
        echo(f"wrote {folder / name}")


def _files(plan: Plan, found: WalkCalibration, place: str) -> Iterator[tuple[str, str]]:
    """The files to write, each with its text. place: their folder, as the mission names it."""
    from kybflow.dsl.expanding.vehicles import written_camera
    from kybflow.dsl.reading.calibration import write_calibration
    from kybflow.dsl.reading.tag_table import write_tags

    lens = f"{found.camera.name}.yaml"
    corrected = {tag.key: tag for tag in found.tags}
    yield TAGS, write_tags(corrected.get(tag.key, tag) for tag in plan.tags)
    yield lens, write_calibration(found.camera.lens)
    camera = written_camera(found.camera, f"{place}/{lens}")
    yield (
        CHANGES,
        (
            "# For the mission, in place of what it has.\n"
            f"world:\n  tags:\n    floor: {{file: {place}/{TAGS}}}\n"
            f"airframe:\n  cameras:\n    {camera}\n"
        ),
    )
