"""The run folder and its files, except for the recording.

Written before the run: `mission.resolved.yaml`, the files that it names, `provenance.json`, and
`foxglove-layout.json`.
During the run: `events.jsonl`, one line per event, and a table per input. After the run:
`summary.json` and `report.html`. Only `provenance.json`, `summary.json` and the folder's name
depend on the wall clock; the other files depend on plan and seed alone.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
from codecs import BOM_UTF8
from collections.abc import Container, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, distribution
from io import FileIO
from pathlib import Path, PurePath
from stat import S_ISREG
from typing import TYPE_CHECKING, Any

from kybflow.core.errors import KybflowError
from kybflow.core.files import CONTROL, File, read_all, write_whole
from kybflow.core.signals import Event, InputReading, Time
from kybflow.dsl.plan import EstimatorPlan, InputPlan, Plan, SensorPlan
from kybflow.dsl.reading.reader import PROVENANCE, RESOLVED
from kybflow.inputs.rows import InputRow, head, line
from kybflow.recording.layout import event_record

if TYPE_CHECKING:
    from datetime import datetime

SUMMARY, EVENTS, LOG, REPORT = "summary.json", "events.jsonl", "log.mcap", "report.html"
FRAMES = "frames"
"""The folder of the camera pictures."""
INPUTS = "inputs"
"""The folder of the input tables (`kybflow.inputs.script`)."""
LAYOUT = "foxglove-layout.json"
"""The layout with which Foxglove shows the recording."""
FILES = frozenset(
    {CONTROL, SUMMARY, EVENTS, LOG, REPORT, RESOLVED, PROVENANCE, FRAMES, INPUTS, LAYOUT}
)
FLOWN_FROM = "files"
"""The key in `provenance.json` that lists the copies of the mission's files."""
_VERSION = re.compile(r"^Version: *(.*)$", re.MULTILINE)
_PACKAGES = ("kybflow", "mujoco", "numpy", "foxglove-sdk", "transitions", "PyYAML", "jsonschema")


class RunFolderError(KybflowError):
    """A folder can't be used for a run; the message says what to do."""


class RunUnwritten(RunFolderError):
    """A file of a run can't be written, for example on a full or read-only disk."""


class GrowingFile:
    """An unbuffered file that a run appends to, so that its contents survive a crash.

    After the first error, `failed` holds the reason and further data is dropped. It counts as an
    error if another program removes, replaces or truncates the file. what: a name for the contents,
    used in `failed`. Raises OSError if the file can't be opened.
    """

    def __init__(self, path: Path, what: str) -> None:
        self._path, self._what = path, what
        # appends, because writing at a position would fill a truncated file up with zeros
        self._file = FileIO(
            path, "w", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666)
        )
        self._size = 0
        self.failed: str | None = None

    @classmethod
    def of_run(cls, path: Path, what: str) -> GrowingFile:
        """Open the file at `path`. Raises RunUnwritten."""
        try:
            return cls(path, what)
        except OSError as error:
            raise RunUnwritten(f"`{path}` can't be written: {error.strerror}") from error

    def write(self, data: bytes) -> int:
        """Append `data` and return its length, even if it can't be written."""
        left = memoryview(data)
        try:
            while left and self.failed is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._fail(error.strerror or str(error))
        self._size += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Return the size of the file. The MCAP writer calls this even with seeking disabled."""
        return self._size

    def flush(self) -> None:
        """Do nothing: the file is unbuffered."""

    def check(self) -> None:
        """Check that the file still holds everything that was written."""
        if self.failed is None and not self._file.closed:
            lost = self._lost()
            if lost:
                self._fail(lost)

    def close(self) -> None:
        """Close the file; may be called again."""
        self.check()
        try:
            self._file.close()
        except OSError as error:
            if self.failed is None:
                self._fail(error.strerror or str(error))

    def _lost(self) -> str | None:
        """Return what another program did to the file, or None."""
        ours = os.fstat(self._file.fileno())
        if not S_ISREG(ours.st_mode):
            return None
        try:
            found = self._path.stat()
        except OSError:
            return f"`{self._path}` was removed or moved"
        if not os.path.samestat(ours, found):
            return f"`{self._path}` was replaced"
        if found.st_size != self._size:
            return f"`{self._path}` has {found.st_size} bytes, but {self._size} were written"
        return None

    def _fail(self, reason: str) -> None:
        self.failed = f"the {self._what} stopped: {reason}"


class RunFolder:
    """The folder of a run. failed: why a file can't be written, None while all can."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._events = GrowingFile(path / EVENTS, "list of events")
        self._unwritten: str | None = None
        self._inputs: dict[str, tuple[GrowingFile, tuple[str, ...]]] = {}

    @property
    def failed(self) -> str | None:
        return next((file.failed for file in self._files if file.failed), self._unwritten)

    @property
    def _files(self) -> tuple[GrowingFile, ...]:
        return (self._events, *(file for file, _ in self._inputs.values()))

    @property
    def log(self) -> Path:
        """The path of the recording."""
        return self.path / LOG

    def event(self, event: Event) -> None:
        """Append an event. Never raises; an error is stored in `failed`, and later events are
        dropped."""
        line = json.dumps(event_record(event), ensure_ascii=False) + "\n"
        self._events.write(line.encode())

    def input(self, name: str, now: Time, reading: InputReading | None, why: str) -> None:
        """Append a reading to an input's table, or the reason `why` there is none. Never raises."""
        row = InputRow(now, {}, lost=why) if reading is None else InputRow(now, *reading[1:3])
        if name in self._inputs:
            file, axes = self._inputs[name]
            file.write(line(row, axes).encode())

    def check(self) -> None:
        """Check that the growing files still hold what was written."""
        for file in self._files:
            file.check()

    def describe(self, plan: Plan, request: Mapping[str, Any], started: datetime) -> None:
        """Write the resolved mission, the files that it names, and `provenance.json`; open the
        input tables. Raises RunUnwritten."""
        files = copies(plan.files, FILES)
        write_file(self.path / RESOLVED, plan.resolved)
        write_file(self.path / PROVENANCE, _json(provenance(plan, request, started, files)))
        for name, file in files.items():
            write_file(self.path / name, contents(file))
        for own in plan.inputs:
            axes: tuple[str, ...] = own.part.cls.axes(own.part.params)
            path = self.path / INPUTS / f"{own.name}.csv"
            try:
                path.parent.mkdir(exist_ok=True)
                table = GrowingFile(path, f"table of `{own.name}`")
            except OSError as error:
                raise RunUnwritten(f"`{path}` can't be written: {error.strerror}") from error
            self._inputs[own.name] = table, axes
            table.write(head(axes).encode())

    def add(self, name: str, data: bytes) -> Path:
        """Write another file of the run and return its path. name: its path within the folder.
        Raises RunUnwritten and leaves no incomplete file."""
        path = self.path / name
        write_file(path, data)
        return path

    def finish(self, summary: dict[str, Any]) -> bool:
        """Close the folder and write the summary; return whether the summary could be written."""
        self.close()
        try:
            write_file(self.path / SUMMARY, _json(summary))
        except RunUnwritten as error:
            self._unwritten = str(error)
            return False
        return True

    def close(self) -> None:
        """Close the growing files; may be called again."""
        for file in self._files:
            file.close()


def whole_lines(path: Path) -> list[str]:
    """Return the complete lines of a growing file; none if there is no file. After a run that was
    killed, the last line may be incomplete and is left out."""
    text = read_all(path).decode() if path.exists() else ""
    return text.split("\n")[:-1]


def create_run_folder(plan: Plan, out: Path | None, started: datetime) -> RunFolder:
    """Create the folder `out`, or `runs/<mission>-<time>` with a number appended if that exists.

    `out` must be new or empty. Raises RunFolderError for a folder with files, RunUnwritten if the
    folder can't be created.
    """
    default = path = Path("runs", f"{plan.mission}-{started:%Y%m%d-%H%M%S}")
    number = 2
    while out is None and path.exists():
        path, number = default.with_name(f"{default.name}-{number}"), number + 1
    path = path if out is None else out
    try:
        path.mkdir(parents=True, exist_ok=True)
        _check_empty(path)
        return RunFolder(path)
    except OSError as error:
        raise RunUnwritten(f"`{path}` can't be written: {error.strerror or error}") from error


def _check_empty(path: Path) -> None:
    """Raise RunFolderError for a folder with files, because a run never replaces files."""
    found, ours = sorted(entry.name for entry in path.iterdir()), set(FILES)
    with suppress(OSError, ValueError, LookupError, TypeError):  # copies of its mission's files
        names = json.loads((path / PROVENANCE).read_text(encoding="utf-8"))[FLOWN_FROM]
        ours |= {PurePath(name).parts[0] for name in names}
    foreign = [name for name in found if name not in ours or EVENTS not in found]
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise RunFolderError(
            f"`{path}` contains files that are not of a run (`{foreign[0]}`{more}); name another "
            "folder"
        )
    if found:
        raise RunFolderError(f"`{path}` contains an earlier run; name another folder, or remove it")


def copies(files: Iterable[File], taken: Container[str]) -> dict[str, File]:
    """Return the mission's files by their path in the run folder.

    The paths are those in the resolved mission, so that the copy can be flown from there. A file is
    left out if its path is `taken` by the run or needed by another file: the compiler reports a
    missing file but would not notice a wrong one.
    """
    placed: dict[str, dict[str, File]] = {}
    for file in files:
        placed.setdefault(os.path.normpath(file.name), {})[file.sha256] = file
    folders = {str(above) for name in placed for above in PurePath(name).parents}
    return {
        name: file
        for name, (file, *others) in ((name, [*of.values()]) for name, of in placed.items())
        if not others and name not in folders and PurePath(name).parts[0] not in taken
    }


def contents(file: File) -> bytes:
    """Return the bytes of a file as they were read, including a byte order mark if there was
    one."""
    data = file.data
    same = hashlib.sha256(data).hexdigest() == file.sha256
    return data if same else BOM_UTF8 + data


def provenance(
    plan: Plan, request: Mapping[str, Any], started: datetime, files: Iterable[str]
) -> dict[str, Any]:
    """Return the content of `provenance.json`: the request, the sources with their SHA-256, the
    paths of the copied `files`, the versions and the machine."""
    parts: list[SensorPlan | EstimatorPlan | InputPlan] = []
    for vehicle in plan.vehicles:
        parts += (*vehicle.sensors, *vehicle.estimators)
    packages = [name for one in (*parts, *plan.inputs) for name in one.part.cls.packages]
    # like `platform.platform()`, which would run `uname -p`
    kernel, libc = f"{platform.system()}-{platform.release()}", "".join(platform.libc_ver())
    return {
        "kybflow": 1,
        "mission": plan.mission,
        "target": plan.target,
        **request,
        "started": started.isoformat(timespec="seconds"),
        "sources": [asdict(source) for source in plan.sources],
        "parts": [asdict(file) for file in plan.part_files],
        FLOWN_FROM: [*files],
        "versions": {"python": platform.python_version(), **_versions((*_PACKAGES, *packages))},
        "machine": {
            "system": f"{kernel}-{platform.machine()}-{libc or 'unknown'}",
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
    }


def _versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of the installed packages. Only the head of their metadata is searched,
    because `importlib.metadata.version` parses all of it as an e-mail and is slow."""
    found = {}
    for package in dict.fromkeys(packages):
        try:
            files = distribution(package)
        except PackageNotFoundError:
            continue
        metadata = files.read_text("METADATA") or files.read_text("PKG-INFO") or ""
        if version := _VERSION.search(metadata):
            found[package] = version[1]
    return found


def _json(value: dict[str, Any]) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_file(path: Path, what: str | bytes) -> None:
    """Write a file of a run completely or not at all. Raises RunUnwritten."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, what if isinstance(what, bytes) else what.encode())
    except OSError as error:
        raise RunUnwritten(f"`{path}` can't be written: {error.strerror or error}") from error
