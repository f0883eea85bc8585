"""A file is written whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from kybflow.core.files import write_whole


def test_the_bytes_are_in_the_file(tmp_path: Path) -> None:
    write_whole(tmp_path / "page", b"long ago")
    write_whole(tmp_path / "page", b"today")
    assert (tmp_path / "page").read_bytes() == b"today"


@pytest.mark.parametrize("before", [None, b"long ago"])
@pytest.mark.parametrize("step", ["write_bytes", "replace"])
def test_whatever_stops_it_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: bytes | None, step: str
) -> None:
    page = tmp_path / "page"
    if before is not None:
        page.write_bytes(before)

    def full(path: Path, given: object) -> None:
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, step, full)
    with pytest.raises(OSError, match="No space left"):
        write_whole(page, b"today")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before] * (before is not None)


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("page")
    write_whole(tmp_path / "link", b"today")
    assert (tmp_path / "link").readlink() == Path("page")
    assert (tmp_path / "page").read_bytes() == b"today"


def test_a_device_is_written_to_and_stays() -> None:
    write_whole(Path(os.devnull), b"today")
    assert Path(os.devnull).is_char_device()


def test_a_file_that_cannot_be_opened_stays(tmp_path: Path) -> None:
    (tmp_path / "page").mkdir()
    with pytest.raises(IsADirectoryError):
        write_whole(tmp_path / "page", b"today")
    assert (tmp_path / "page").is_dir()
