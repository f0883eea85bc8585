"""Creates the socket of a run and finds it again.

The folder of sockets is `$XDG_RUNTIME_DIR/kybflow`, or `/tmp/kybflow-UID` if the user has no such
directory; only the user may enter it. A socket is named after its run folder, where the file
`control.json` holds the socket's path. If a run was killed, the next run removes its socket.
"""

from __future__ import annotations

import errno
import json
import os
import pwd
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from kybflow.core.errors import KybflowError
from kybflow.core.files import CONTROL, read_all, write_whole

SUFFIX = ".sock"
LONGEST_PATH = 107
"""The most bytes in a socket's path (`sun_path` in unix(7), without the final zero byte)."""
_SOCKET_NAME_BYTES = 40
"""Bytes of the longest path that must remain for the name of a socket."""
_TEMPORARY = "/tmp"
_PEER = struct.Struct("3i")
"""The format of SO_PEERCRED, socket(7): pid, uid, gid."""


class AddressError(KybflowError):
    """A socket can't be created; the message says why."""


class RunNotFound(KybflowError):
    """No run has the given name, or more than one has; the message lists the runs."""


class PeerProcess(NamedTuple):
    """The process at the other end of a socket, as the kernel reports it. pid: 0 for a process in
    another container."""

    pid: int
    uid: int


def peer_of(connected: socket.socket) -> PeerProcess:
    """Return the process at the other end of a socket. Raises OSError."""
    data = connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
    pid, uid, _ = _PEER.unpack(data)
    return PeerProcess(pid, uid)


def user_name(uid: int) -> str:
    """Return a user's name, or `user NUMBER` if the user has none."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"user {uid}"


def folders() -> Iterator[Path]:
    """Yield the folders where this user's sockets may be, preferred one first."""
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    if os.path.isabs(given) and _is_own(given):
        path = Path(given, "kybflow")
        if len(os.fsencode(path)) + _SOCKET_NAME_BYTES <= LONGEST_PATH:
            yield path
    yield Path(_TEMPORARY, f"kybflow-{os.geteuid()}")


def _is_own(path: str | Path) -> bool:
    try:
        found = os.lstat(path)
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()


def _is_private(path: Path) -> bool:
    return _is_own(path) and stat.S_IMODE(os.lstat(path).st_mode) & 0o077 == 0


def private_folder() -> Path:
    """Return the folder of sockets; create it if necessary. Raises AddressError."""
    reasons = []
    for path in folders():
        try:
            path.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            reasons.append(f"`{path}` can't be made: {error.strerror}")
            continue
        if _is_private(path):
            return path
        reasons.append(f"`{path}` is not a folder that only user {os.geteuid()} may enter")
    raise AddressError("; ".join(reasons))


def listen(name: str, backlog: int) -> tuple[socket.socket, Path]:
    """Return a listening socket for the run `name`, and its path. Raises AddressError."""
    folder = private_folder()
    remove_stale(folder)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
    temporary = folder / f".{os.getpid()}-{id(listener):x}"
    try:
        listener.bind(os.fspath(temporary))
        temporary.chmod(0o600)
        listener.listen(backlog)
        # a socket gets the suffix only after it listens, so that no other run takes it for stale
        return listener, _published(temporary, folder, name)
    except OSError as error:
        listener.close()
        reason = error.strerror or error
        raise AddressError(f"no socket can be made in `{folder}`: {reason}") from None
    finally:
        with suppress(OSError):
            temporary.unlink()


def _published(temporary: Path, folder: Path, name: str) -> Path:
    """Link a socket to its name, with a number appended if another run has the name. Return the
    path."""
    room = LONGEST_PATH - len(os.fsencode(folder)) - len(f"/-99{SUFFIX}")
    short = os.fsdecode(os.fsencode(name)[:room])
    for number in range(1, 100):
        path = folder / f"{short}{f'-{number}' if number > 1 else ''}{SUFFIX}"
        with suppress(FileExistsError):
            os.link(temporary, path)
            return path
    raise OSError(errno.EEXIST, "too many runs have the same name")


def remove_stale(folder: Path) -> None:
    """Remove the sockets of runs that were killed."""
    for path in folder.glob(f"*{SUFFIX}"):
        if not is_served(path):
            with suppress(OSError):
                path.unlink()


def is_served(path: Path) -> bool:
    """Return whether a process listens at a socket. Never waits."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
        try:
            return probe.connect_ex(os.fspath(path)) in (0, errno.EAGAIN)
        except (OSError, ValueError):  # a path that no socket can have
            return False


def write_address(folder: Path, path: Path) -> None:
    """Write the path of the socket into the run folder. Raises OSError."""
    text = json.dumps({"kybflow": 1, "socket": os.fspath(path), "pid": os.getpid()})
    write_whole(folder / CONTROL, text.encode() + b"\n")


def find_run(run: str | None) -> Path:
    """Return the path of a run's socket. run: the run's folder, its name, or the beginning of its
    name before a `-`; None for the only running one. Raises RunNotFound."""
    if run is not None and os.path.exists(Path(run) / CONTROL):
        return _address_in(Path(run))
    private = (folder for folder in folders() if _is_private(folder))
    sockets = {path for folder in private for path in folder.glob(f"*{SUFFIX}")}
    flying = sorted(path for path in sockets if is_served(path))
    whole = [path for path in flying if run in (None, _name(path))]
    fitting = whole or [path for path in flying if _name(path).startswith(f"{run}-")]
    if len(fitting) == 1:
        return fitting[0]
    if run is not None and not fitting and os.path.isdir(run):
        raise RunNotFound(f"no run that accepts commands flies in `{run}`")
    names = ", ".join(f"`{_name(path)}`" for path in fitting or flying)
    if fitting:
        raise RunNotFound(f"several runs fly: {names}; name one of them")
    which = "" if run is None else f" called `{run}`"
    others = f"; there is {names}" if flying else ""
    raise RunNotFound(f"no run{which} flies and accepts commands{others}")


def _name(path: Path) -> str:
    return path.name.removesuffix(SUFFIX).encode(errors="backslashreplace").decode()


def _address_in(folder: Path) -> Path:
    try:
        path = Path(json.loads(read_all(folder / CONTROL))["socket"])
    except (OSError, ValueError, LookupError, TypeError):
        raise RunNotFound(f"`{folder / CONTROL}` has no path of a socket") from None
    if not is_served(path):
        raise RunNotFound(f"the run in `{folder}` was killed: no process listens at `{path}`")
    return path
