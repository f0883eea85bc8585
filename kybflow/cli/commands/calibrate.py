"""`kybflow calibrate`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from kybflow.cli.arguments import Sets, Target, compiled, failing, refusing, unknown, writing, wrong
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED
from kybflow.core.files import write_whole
from kybflow.vision import WAY_OUT


def command(
    mission: Annotated[Path, Argument(help="A mission with the uncorrected tags and camera.")],
    *,
    frames: Annotated[Path, Option(help="A video of the walk, or a folder of images.")],
    poses: Annotated[Path | None, Option(help="A table of poses, or the folder of a run.")] = None,
    standing: Annotated[
        bool, Option("--standing", help="The vehicle stands on its start at first.")
    ] = False,
    vehicle: Annotated[str | None, Option(help="The vehicle with the camera.")] = None,
    camera: Annotated[str | None, Option(help="The camera of the vehicle.")] = None,
    folder: Annotated[Path | None, Option("--write", help="Folder for the corrections.")] = None,
    target: Target = None,
    sets: Sets,
) -> None:
    """Correct a camera's lens and mount and the map of tags from frames of a walk over the tags.

    --poses gives the body's poses during the walk; --standing says that the first frame shows the
    vehicle on its start. --write saves the corrected map and camera, and the changes of the
    mission.

    \b
    Exit codes:
    0: corrections were found.
    1: the frames yield no corrections.
    2: the mission is invalid, or a file can't be read.

    \b
    Examples:
      kybflow calibrate floor.yaml --frames walk.avi
      kybflow calibrate floor.yaml --frames walk.avi --standing --write lab
      kybflow calibrate floor.yaml --frames walk/ --poses walk.csv --write lab
    """
    from kybflow.api.calibration import corrections, is_of_a_run, recorded_track
    from kybflow.core.errors import CalibrationFailed, DriverError, FileError

    plan, _ = compiled(mission, target, sets)
    flying = {own.name: own for own in plan.vehicles if own.cameras}
    if not flying:
        raise wrong("MISSION", f"no vehicle of `{plan.mission}` has a camera")
    whose = flying[_chosen(vehicle, flying, "vehicle with a camera", "--vehicle")]
    lens = whose.cameras[_chosen(camera, whose.cameras, "camera", "--camera")]
    if poses is not None and standing:
        raise wrong(None, "give --poses or --standing, not both")
    if not len(plan.tags):
        raise wrong("MISSION", f"`{mission}` has no tags; add them in `world: {{tags: ...}}`")
    if not (frames.is_file() or frames.is_dir()):
        what = "is neither a file nor a folder" if frames.exists() else "doesn't exist"
        raise wrong("--frames", f"`{frames}` {what}; give a video or a folder of images")
    if is_of_a_run(frames):
        what = "belongs to a run, which keeps only a few frames, scaled and drawn on"
        raise wrong("--frames", f"`{frames}` {what}; record a video")
    with refusing("--poses", FileError):
        track = None if poses is None else recorded_track(poses, whose.name)
    try:
        from kybflow.vision.calibration.walk import MOST_FRAMES, Standing, calibrated, recorded
    except ImportError as error:
        raise wrong(None, f"frames need OpenCV ({error}); {WAY_OUT}") from None
    from kybflow.cli.printing.calibration import calibration_lines

    known = Standing(whose.start, whose.heading) if standing else track
    with failing(FAILED, CalibrationFailed, DriverError):
        recording = recorded(frames, lens, MOST_FRAMES)
        found = calibrated(recording.frames, lens, plan.tags, known)
    echo("\n".join(calibration_lines(found, len(recording.frames), recording.total)))
    if folder is None:
        return
    with writing(folder, "--write"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, text in corrections(plan, found, folder, mission).items():
        with writing(folder / name, "--write"):
            write_whole(folder / name, text.encode())
        echo(f"wrote {folder / name}")


def _chosen(name: str | None, known: Iterable[str], what: str, option: str) -> str:
    """Return `name` if it is among `known`; without a name, the only one of `known`. Raises
    BadParameter."""
    names = list(known)
    if name is not None and name not in names:
        raise unknown(f"there is no {what}", name, names, option)
    if name is None and len(names) > 1:
        raise wrong(option, f"name one of {', '.join(f'`{one}`' for one in names)}")
    return name or names[0]
