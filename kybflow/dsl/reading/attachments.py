"""The name of a file in a mission to what it holds: read once, judged by the part that reads it."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from kybflow.core.errors import FileError
from kybflow.core.files import File, FilePath
from kybflow.core.params import Field
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import Document, PartUse
from kybflow.dsl.plan import SourceFile
from kybflow.dsl.reading.nodes import Scalar
from kybflow.dsl.shaping.world.tag_params import TagFile

CODES = {
    "KYB370": "A file that a parameter names is missing, unreadable, too large, or elsewhere.",
    "KYB371": "A file that its part can't use, and the line.",
}
MAX_BYTES = 4_000_000
_SHOWN = 60


def attached(node: Scalar, field: Field, found: list[Diagnostic]) -> File | None:
    """The file that `node` names, beside or below the file in which it stands; None, and a finding,
    when its part can't use it."""
    try:
        file = _read(node.text, Path(node.span.file).parent)
    except FileError as error:
        found.append(Diagnostic("KYB370", str(error), node.span, help=error.hint))
        return None
    try:
        if field.reads is not None:
            field.reads(file)
    except FileError as error:
        found.append(_unusable(node, file, error))
        return None
    return file


def file_of(node: Scalar, field: Field, found: list[Diagnostic]) -> File | FilePath | None:
    """The file that `node` names; None, and a finding, where it can't be had."""
    return attached(node, field, found) if field.shape == "file" else _path_of(node, found)


def _path_of(node: Scalar, found: list[Diagnostic]) -> FilePath | None:
    """Where the file is that `node` names, as seen from the file in which it stands; None, and a
    finding, when there is none."""
    path = os.path.abspath(os.path.join(os.path.dirname(node.span.file), node.text))
    if "\0" not in path and os.path.isfile(path):
        return FilePath(path)
    hint = "name a file that is there, as seen from the folder of the one that names it"
    found.append(Diagnostic("KYB370", f"`{node.text}` is no file", node.span, help=hint))
    return None


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


def _unusable(node: Scalar, file: File, error: FileError) -> Diagnostic:
    notes: tuple[str, ...] = ()
    if error.line:
        text = file.text.splitlines()[error.line - 1].strip()
        shown = text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
        notes = (f"{file.name}:{error.line}: {shown}",)
    label = f"line {error.line}" if error.line else ""
    return Diagnostic("KYB371", f"`{file.name}`: {error}", node.span, label, notes, error.hint)


def _read(name: str, folder: Path) -> File:
    hint = "name a file beside or below the one that names it"
    try:
        path = (folder / name).resolve()
        if Path(name).is_absolute() or not path.is_relative_to(folder.resolve()):
            raise FileError(f"`{name}` is outside of the mission's folder", hint=hint)
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileError(f"`{name}` is no file", hint=hint)
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise FileError(f"`{name}` is no file", hint=hint) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"`{name}` can't be read: {reason.lower()}") from None
    if len(data) > MAX_BYTES:
        raise FileError(f"`{name}` is larger than {MAX_BYTES // 1_000_000} MB")
    try:
        return File(name, hashlib.sha256(data).hexdigest(), data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileError(f"`{name}` is not UTF-8 text in line {line}") from None
