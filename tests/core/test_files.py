"""A file is written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from kybflow.core.files import write_whole


def test_the_bytes_are_in_the_file(tmp_path: Path) -> None:
    write_whole(tmp_path / "page", b"long ago")
    write_whole(tmp_path / "page", b"today")
    assert (tmp_path / "page").read_bytes() == b"today"


def test_whatever_stops_it_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_whole(tmp_path / "page", "no bytes")  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_leaves_no_half(tmp_path: Path) -> None:
    (tmp_path / "page").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"):
        write_whole(tmp_path / "page", b"today")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_opened_stays(tmp_path: Path) -> None:
    (tmp_path / "page").mkdir()
    with pytest.raises(IsADirectoryError):
        write_whole(tmp_path / "page", b"today")
    assert (tmp_path / "page").is_dir()
