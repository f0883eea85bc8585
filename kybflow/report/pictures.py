"""The pictures of camera frames in a run folder, and how a report shows them."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from kybflow.recording.run_folder import FRAMES

MOST = 96
"""Pictures in one report; a fleet's others are in its folder."""
_NAME = re.compile(r"(\d+\.\d+)s-(?:(\d+)-used-(\d+)-rejected|no-pose)\.jpg")


@dataclass(frozen=True)
class Picture:
    """A frame with what was found in it. time: seconds. used, rejected: tags; None where it told no
    pose."""

    vehicle: str
    estimator: str
    camera: str
    time: float
    used: int | None
    rejected: int | None
    data: bytes


def read_pictures(folder: Path) -> tuple[Picture, ...]:
    """Those of a run, of each camera in order. Raises OSError."""
    found: list[Picture] = []
    for path in sorted((folder / FRAMES).glob("*/*/*/*.jpg")):
        named = _NAME.fullmatch(path.name)
        if named is not None and len(found) < MOST:
            found.append(_picture(path, *named.groups()))
    return tuple(found)


def _picture(path: Path, time: str, used: str | None, rejected: str | None) -> Picture:
    vehicle, estimator, camera = path.parts[-4:-1]
    return Picture(
        vehicle,
        estimator,
        camera,
        float(time),
        None if used is None else int(used),
        None if rejected is None else int(rejected),
        path.read_bytes(),
    )


def pictures(found: Sequence[Picture]) -> str:
    """Those of one estimator, camera by camera."""
    cameras = dict.fromkeys(picture.camera for picture in found)
    return "".join(
        f"<h3>What camera <code>{escape(camera)}</code> saw</h3>"
        f'<p class="note">{_NOTE}</p><div class="pictures">'
        + "".join(_figure(picture) for picture in found if picture.camera == camera)
        + "</div>"
        for camera in cameras
    )


_NOTE = "Green: tags that the pose rests on. Red: found, and left out of it."


def _figure(picture: Picture) -> str:
    said = f"{picture.time:.2f} s: {_told(picture)}"
    data = base64.b64encode(picture.data).decode()
    return (
        f'<figure><img alt="{escape(said)}" src="data:image/jpeg;base64,{data}">'
        f"<figcaption>{escape(said)}</figcaption></figure>"
    )


def _told(picture: Picture) -> str:
    if picture.used is None:
        return "no pose"
    tags = f"{picture.used} {'tag' if picture.used == 1 else 'tags'} used"
    return f"{tags}, {picture.rejected} left out" if picture.rejected else tags
