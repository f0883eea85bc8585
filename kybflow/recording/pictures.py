"""Writes camera pictures into the run folder, as an observer of the engine.

For each camera of each estimator it keeps a few frames: some spread evenly over the flight, however
long it is, and some from when the vehicle changed to another estimator. The files are

    frames/VEHICLE/ESTIMATOR/CAMERA/0012.345s-9-used-1-rejected.jpg
    frames/VEHICLE/ESTIMATOR/CAMERA/0012.345s-no-pose.jpg

named by the time of the frame and the numbers of tags. If a file can't be written, the observer
raises RunFolderError; the engine reports the error, drops the observer and flies on.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from kybflow.core.signals import NS, Frame, Time
from kybflow.recording.run_folder import FRAMES, RunFolder

if TYPE_CHECKING:
    from kybflow.runtime.engine import Engine
    from kybflow.vision.locating.locate import Located
    from kybflow.vision.locating.locator import Sighting

EVEN_PICTURES, CHANGE_PICTURES = 8, 4
"""The most pictures of a camera that are spread evenly, and the most at changes of the estimator.
"""
_FIRST_PACE = NS


class Pictures:
    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder
        self._albums: dict[str, _Album] = {}
        self._used: dict[str, str | None] = {}

    def __call__(self, engine: Engine) -> None:
        if engine.flying:
            for vehicle in engine.vehicles:
                used = vehicle.estimator
                changed = self._used.setdefault(vehicle.name, used) != used
                self._used[vehicle.name] = used
                for label, part in vehicle.knowledge.parts().items():
                    if part.sighting is not None:
                        place = f"{FRAMES}/{vehicle.name}/{label.rpartition('.')[2]}"
                        self._offer(place, part.sighting, changed)

    def _offer(self, place: str, sighting: Sighting, changed: bool) -> None:
        for frame in sighting.frames:
            name = f"{place}/{frame.camera}"
            if name not in self._albums:
                self._albums[name] = _Album(self._folder, name)
            self._albums[name].offer(frame, sighting.located, changed)


class _Album:
    """The pictures of one camera. If there are too many evenly spread ones, every other one is
    deleted and the time between them doubles."""

    def __init__(self, folder: RunFolder, place: str) -> None:
        self._folder, self._place = folder, place
        self._evenly: list[str] = []
        self._at_changes: list[str] = []
        self._pace, self._due = _FIRST_PACE, 0

    def offer(self, frame: Frame, located: Located | None, changed: bool) -> None:
        is_due = frame.time >= self._due
        is_kept = changed and len(self._at_changes) < CHANGE_PICTURES
        if not is_due and not is_kept:
            return
        name = f"{self._place}/{_name(frame.time, frame.camera, located)}"
        if name not in self._evenly and name not in self._at_changes:
            self._folder.add(name, _picture(frame, located))
        if is_kept and name not in self._at_changes:
            self._at_changes.append(name)
        if not is_due:
            return
        self._evenly.append(name)
        if len(self._evenly) > EVEN_PICTURES:
            self._pace *= 2
            dropped, self._evenly = self._evenly[1::2], self._evenly[::2]
            for spare in (name for name in dropped if name not in self._at_changes):
                with suppress(OSError):
                    (self._folder.path / spare).unlink()
        self._due = frame.time + self._pace


def _name(time: Time, camera: str, located: Located | None) -> str:
    stamp = f"{time / NS:08.3f}s"
    if located is None:
        return f"{stamp}-no-pose.jpg"
    tags = [tag for view in located.views if view.camera.name == camera for tag in view.tags]
    used = sum(tag.key in located.used for tag in tags)
    return f"{stamp}-{used}-used-{len(tags) - used}-rejected.jpg"


def _picture(frame: Frame, located: Located | None) -> bytes:
    from kybflow.vision.images import marked

    if located is None:
        return marked(frame.image, None, ())
    view = next((view for view in located.views if view.camera.name == frame.camera), None)
    return marked(frame.image, view, located.used)
