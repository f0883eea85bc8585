"""Where the socket of a run is, who may enter, and how it is found."""

from __future__ import annotations

import os
import shutil
import socket
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from kybflow.command_server import address
from kybflow.command_server.address import (
    LONGEST_PATH,
    AddressError,
    RunNotFound,
    find_run,
    is_served,
    listen,
    write_address,
)

ROOT_ONLY = pytest.mark.skipif(os.geteuid() != 0, reason="gives a folder to another user")
NOBODY = 65534


@pytest.fixture
def user(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with an XDG_RUNTIME_DIR and a `/tmp` of its own, short enough for a socket."""
    path = Path(tempfile.mkdtemp(dir="/tmp"))
    (path / "xdg").mkdir(mode=0o700)
    (path / "tmp").mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(path / "xdg"))
    monkeypatch.setattr(address, "_TEMPORARY", str(path / "tmp"))
    yield path
    shutil.rmtree(path)


@pytest.fixture
def opened() -> Iterator[list[socket.socket]]:
    """Sockets to be closed after the test."""
    found: list[socket.socket] = []
    yield found
    for one in found:
        one.close()


@pytest.fixture
def flying(opened: list[socket.socket]):
    def flying(name: str) -> Path:
        """The socket of a run that flies."""
        listener, path = listen(name, 4)
        opened.append(listener)
        return path

    return flying


def own(user: Path) -> Path:
    return user / "tmp" / f"kybflow-{os.geteuid()}"


def test_the_folder_is_the_users_alone(user: Path, flying) -> None:
    path = flying("eight-1")
    assert path == user / "xdg" / "kybflow" / "eight-1.sock"
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert is_served(path)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("value", [None, "", "relative", "/nowhere/at/all", "FILE"])
def test_without_a_runtime_folder_it_is_in_tmp(
    user: Path, flying, monkeypatch: pytest.MonkeyPatch, value: str | None
) -> None:
    if value == "FILE":
        (user / "file").touch()
        value = str(user / "file")
    if value is None:
        monkeypatch.delenv("XDG_RUNTIME_DIR")
    else:
        monkeypatch.setenv("XDG_RUNTIME_DIR", value)
    assert flying("eight").parent == own(user)


@ROOT_ONLY
def test_the_runtime_folder_of_another_is_not_used(user: Path, flying) -> None:
    os.chown(user / "xdg", NOBODY, NOBODY)
    assert flying("eight").parent == own(user)


def test_a_folder_that_others_may_enter_is_not_used(user: Path, flying) -> None:
    (user / "xdg" / "kybflow").mkdir()
    (user / "xdg" / "kybflow").chmod(0o755)
    assert flying("eight").parent == own(user)


@pytest.mark.parametrize("spoil", ["open", "link", "file", pytest.param("other", marks=ROOT_ONLY)])
def test_where_no_folder_is_safe_there_is_no_socket(
    user: Path, monkeypatch: pytest.MonkeyPatch, spoil: str
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    path = own(user)
    if spoil == "link":
        path.symlink_to(user / "xdg")
    elif spoil == "file":
        path.touch()
    else:
        path.mkdir()
        path.chmod(0o755 if spoil == "open" else 0o700)
    if spoil == "other":
        os.chown(path, NOBODY, NOBODY)
    with pytest.raises(AddressError, match=f"{path}"):
        listen("eight", 4)
    with pytest.raises(RunNotFound):
        find_run(None)


def test_the_path_is_never_too_long(user: Path, flying, monkeypatch: pytest.MonkeyPatch) -> None:
    path, other = flying("ä" * 120), flying("ä" * 120)
    assert len(os.fsencode(other)) <= len(os.fsencode(path)) + 2 <= LONGEST_PATH
    assert path != other
    deep = user / ("d" * 100)
    deep.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(deep))
    assert flying("eight").parent == own(user)


def test_runs_of_one_name_have_a_socket_each(user: Path, flying) -> None:
    assert [flying("run").name for _ in range(3)] == ["run.sock", "run-2.sock", "run-3.sock"]


def test_what_a_killed_run_left_is_removed_by_the_next(
    user: Path, flying, opened: list[socket.socket]
) -> None:
    dead, alive = flying("dead"), flying("alive")
    opened[0].close()
    assert dead.exists()
    flying("next")
    assert not dead.exists()
    assert is_served(alive)


def test_a_run_is_found_by_folder_name_mission_or_because_it_is_alone(
    user: Path, flying, tmp_path: Path
) -> None:
    path = flying("eight-20260301-101500")
    write_address(tmp_path, path)
    named = ("eight-20260301-101500", "eight", str(tmp_path), None)
    assert [find_run(name) for name in named] == [path] * 4


def test_what_is_not_clear_is_refused_with_what_there_is(
    user: Path, flying, tmp_path: Path
) -> None:
    with pytest.raises(RunNotFound, match=r"^no run flies and accepts commands$"):
        find_run(None)
    with pytest.raises(RunNotFound, match=f"^no run that accepts commands flies in `{tmp_path}`$"):
        find_run(str(tmp_path))
    one, _ = flying("eight-1"), flying("eight-2")
    with pytest.raises(RunNotFound, match="several runs fly: `eight-1`, `eight-2`; name one"):
        find_run("eight")
    with pytest.raises(
        RunNotFound, match=r"no run called `nine` .*; there is `eight-1`, `eight-2`"
    ):
        find_run("nine")
    assert find_run("eight-1") == one


def test_the_folder_of_a_killed_run_says_so(
    user: Path, flying, opened: list[socket.socket], tmp_path: Path
) -> None:
    write_address(tmp_path, flying("eight"))
    opened[0].close()
    with pytest.raises(RunNotFound, match="was killed"):
        find_run(str(tmp_path))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"socket": 3}', "\ufffd"])
def test_a_broken_address_is_told(user: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "control.json").write_text(text)
    with pytest.raises(RunNotFound, match="has no path of a socket"):
        find_run(str(tmp_path))


@pytest.mark.parametrize("path", ["x" * 200, "a\\u0000b"])
def test_an_address_that_no_socket_can_have_is_nobodys(
    user: Path, tmp_path: Path, path: str
) -> None:
    (tmp_path / "control.json").write_text(f'{{"socket": "{path}"}}')
    with pytest.raises(RunNotFound, match="was killed"):
        find_run(str(tmp_path))
