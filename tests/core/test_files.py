"""A file is written whole or not at all, and only a regular file is read."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from kybflow.core.files import NotRegular, read_regular, write_whole


def test_a_regular_file_is_read_up_to_a_bound(tmp_path: Path) -> None:
    (tmp_path / "page").write_bytes(b"today")
    assert read_regular(tmp_path / "page", 5) == b"today"
    assert read_regular(tmp_path / "page", 3) == b"toda"
    with pytest.raises(FileNotFoundError):
        read_regular(tmp_path / "none", 3)


def test_what_would_block_or_never_end_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path / "link", Path("/dev/zero"), tmp_path):
        with pytest.raises(NotRegular, match="not a regular file"):
            read_regular(path, 100)


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
