"""The files that parameters of a mission name, as the plan records them."""

from __future__ import annotations

import os
from collections.abc import Iterator

from kybflow.core.files import File
from kybflow.dsl.document import Document, PartUse
from kybflow.dsl.plan import SourceFile
from kybflow.dsl.shaping.world.tag_params import TagFile


def attachments_of(document: Document) -> tuple[SourceFile, ...]:
    """Every file that a parameter of the mission names, once."""
    found: dict[str, SourceFile] = {}
    for file, beside in _named(document):
        path = os.path.normpath(os.path.join(beside, file.name))
        found[path] = SourceFile(path, file.sha256)
    return tuple(found.values())


def files_of(document: Document) -> tuple[File, ...]:
    """What every file held that a parameter of the mission names; once for each name."""
    return tuple(dict.fromkeys(file for file, _ in _named(document)))


def _named(document: Document) -> Iterator[tuple[File, str]]:
    """Each file that a parameter names, and the folder beside which it does."""
    for use in _uses(document):
        for field in use.spec.fields:
            file = getattr(use.params, field.name)
            if isinstance(file, File):
                yield file, os.path.dirname(use.spans[field.name].file)
    for tags in document.tags:
        if isinstance(tags.params, TagFile):
            yield tags.params.file, os.path.dirname(tags.span.file)
    for vehicle in document.vehicles.values():
        for camera in vehicle.cameras:
            if camera.params.calibration is not None:
                beside = os.path.dirname(camera.spans["calibration"].file)
                yield camera.params.calibration, beside


def _uses(document: Document) -> Iterator[PartUse]:
    for vehicle in document.vehicles.values():
        yield from (s.part for s in vehicle.sensors)
        yield from (e.part for e in vehicle.estimators)
        yield from (*vehicle.processors, vehicle.tracker, *vehicle.supervisors, vehicle.driver)
        yield from (state.part for state in vehicle.states.values())
