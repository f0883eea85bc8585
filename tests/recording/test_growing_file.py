"""A file that grows while a run flies notices what others do to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from kybflow.recording.run_folder import GrowingFile


def replace(path: Path) -> None:
    path.unlink()
    path.write_bytes(b"onetwo")


def shorten(path: Path) -> None:
    with path.open("wb"):
        pass


def test_what_nobody_touches_is_whole(tmp_path: Path) -> None:
    file = GrowingFile(tmp_path / "log", "recording")
    assert [file.write(b"one"), file.write(b"two"), file.seek(0)] == [3, 3, 6]
    file.check()
    file.close()
    file.close()
    assert (file.failed, (tmp_path / "log").read_bytes()) == (None, b"onetwo")


@pytest.mark.parametrize("notices", [GrowingFile.check, GrowingFile.close])
@pytest.mark.parametrize(
    ("loses", "words"),
    [
        (Path.unlink, "was removed or moved"),
        (lambda path: path.rename(path.with_name("moved")), "was removed or moved"),
        (replace, "was replaced"),
        (shorten, "has 3 bytes, but 6 were written"),
    ],
)
def test_what_is_lost_is_told(
    tmp_path: Path,
    loses: Callable[[Path], object],
    words: str,
    notices: Callable[[GrowingFile], None],
) -> None:
    path = tmp_path / "log"
    file = GrowingFile(path, "recording")
    file.write(b"one")
    loses(path)
    file.write(b"two")
    notices(file)
    assert file.failed == f"the recording stopped: `{path}` {words}"
    file.close()
