"""The files that a mission names, as they stand in its run folder: under the names that the
resolved mission gives them, so that it flies from there."""

from __future__ import annotations

import hashlib
import os.path
from codecs import BOM_UTF8
from collections.abc import Container, Iterable
from pathlib import PurePath

from kybflow.core.files import File


def copies(files: Iterable[File], taken: Container[str]) -> dict[str, File]:
    """Where in the run folder each of `files` goes. One whose place is not its own is left out: a
    wrong file there would fly, and none is told. Its place may be `taken` by the run itself, or by
    a file of the same name from beside another file of the mission."""
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
    """The bytes of a file, as they were read: its text, and the mark before it where it had one."""
    data = file.text.encode()
    same = hashlib.sha256(data).hexdigest() == file.sha256
    return data if same else BOM_UTF8 + data
