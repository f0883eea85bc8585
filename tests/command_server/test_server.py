"""A run that is served: what clients hear, and what they can't do to it."""

from __future__ import annotations

import errno
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing

import pytest
from served_commands import Served, served
from waiting import until

from kybflow.command_server import server
from kybflow.command_server.client import CommandRefused, RunClient, RunUnreachable, connect
from kybflow.command_server.protocol import LONGEST_LINE, command, introduction, question
from kybflow.command_server.server import (
    CUT_OFF,
    MOST_CLIENTS,
    MOST_RESTRICTED,
    OTHER_USERS,
    SLOW_READERS,
    UNREADABLE,
    CommandServer,
)
from kybflow.core.signals import NS, Event
from kybflow.dsl.plan import Emit, Switch
from kybflow.runtime.commanding.orders import Answer, PauseOrder, text


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    with served(monkeypatch.setenv) as run:
        yield run


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """A run that ticks only when the test says so."""
    with served(monkeypatch.setenv, ticks=False) as run:
        yield run


def spoken(run: Served) -> list[str]:
    return [text(given.order) for given in run.given]


def test_a_command_is_given_with_its_giver_and_answered(run: Served) -> None:
    with run.client("anna") as anna:
        assert anna.switch("mk", "down", take=True) == Answer(True)
        assert anna.pause() == Answer(True)
    assert [(g.order, g.by, g.take) for g in run.given] == [
        (Switch("mk", "down"), "anna", True),
        (PauseOrder(), "anna", False),
    ]


def test_every_command_has_a_method_that_spells_it(run: Served) -> None:
    with run.client() as anna:
        anna.emit("operator.go")
        anna.switch("mk", "goto", position=(1, 0.5, 1), heading=None, speed="50 cm/s", take=True)
        anna.set("mk.processors.fence.margin", "30 cm")
        anna.enable("mk.processors.fence")
        anna.disable("mk.processors.fence")
        anna.phase("swarm", "gather")
        anna.track("mk", 12.5, (1, 0.5, 1), velocity=(0.1, 0, 0))
        anna.resume("mk")
        anna.reset()
        anna.land("mk", "nano")
        anna.stop("enough")
        anna.release()
    assert spoken(run) == [
        "emit operator.go", "switch mk goto position=[1, 0.5, 1] heading=null speed=50 cm/s",
        "set mk.processors.fence.margin 30 cm", "enable mk.processors.fence",
        "disable mk.processors.fence", "phase swarm gather",
        "track mk time=12.5 position=[1.0, 0.5, 1.0] velocity=[0.1, 0.0, 0.0]",
        "resume mk", "reset", "land mk nano", "stop enough", "release",
    ]  # fmt: skip


def test_a_commander_without_a_name_is_the_process_that_the_kernel_knows(run: Served) -> None:
    with closing(run.raw()) as raw:
        raw.send(command(1, "land"))
        assert raw.read() == {"id": 1, "accepted": True, "reason": ""}
    assert run.given[0].by.endswith(f", process {os.getpid()}")


def test_a_name_is_said_once(run: Served) -> None:
    with closing(run.raw()) as raw:
        raw.send(introduction(1, "anna") + introduction(2, "ben"))
        assert [raw.read()["accepted"], raw.read()["reason"]] == [
            True,
            "this client is called `anna` already",
        ]


def test_the_state_is_asked_in_the_tick(run: Served) -> None:
    with run.client() as anna:
        state = anna.state()
    assert (state["mission"], state["time"], state["vehicles"]) == ("eight", 1.5, [])


def test_who_watches_hears_events_until_the_run_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    with served(monkeypatch.setenv) as run:
        run.server.on_event(Event(NS, "too_early", "", {}))
        with run.client() as anna:
            heard = anna.watch()
        for k in range(3):
            run.server.on_event(Event(k * NS, "landed", "mk", {"reason": None}, "a.yaml:3"))
        assert next(heard) == {
            "t_s": 0.0, "event": "landed", "vehicle": "mk", "at": "a.yaml:3",
            "fields": {"reason": None},
        }  # fmt: skip
        rest: list[float] = []
        reader = threading.Thread(target=lambda: rest.extend(said["t_s"] for said in heard))
        reader.start()
        run.server.on_event(Event(7 * NS, "run_ended", "", {}))
    reader.join()
    assert rest == [1.0, 2.0, 7.0]


def test_events_that_come_too_fast_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_EVENTS", 2)
    watched = CommandServer()
    watched.watched(True)
    for k in range(5):
        watched.on_event(Event(k * NS, "landed", "mk", {}))
    *told, last = [json.loads(line) for line in watched.events()]
    assert ([one["event"]["t_s"] for one in told], last) == ([0.0, 1.0], {"missed": 3})
    assert list(watched.events()) == []


def test_every_event_is_heard_or_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_EVENTS", 2)
    with served(monkeypatch.setenv) as run:
        with run.client() as anna:
            heard = anna.watch()
        for k in range(5000):
            run.server.on_event(Event(k, "landed", "mk", {}))
    assert sum(one["fields"].get("count", 1) for one in heard) == 5000


def test_the_lease_of_who_hangs_up_is_free(run: Served) -> None:
    with run.client("anna") as anna, run.client("watcher") as watcher:
        twin = run.client("anna")
        anna.switch("mk", "down")
        twin.switch("mk", "up")
        watcher.state()
        twin.close()
        run.client("shell", keeps_lease=True).close()
    until(lambda: run.gone, "the departure of the last anna")
    assert run.gone == ["anna"]


def test_who_keeps_the_lease_keeps_it(run: Served) -> None:
    with run.client("shell", keeps_lease=True) as shell:
        shell.switch("mk", "down")
    with run.client("anna") as anna:
        anna.switch("mk", "up")
    until(lambda: run.gone, "the departure of anna")
    assert run.gone == ["anna"]


def test_a_client_killed_in_the_middle_of_a_message_loses_only_that(run: Served) -> None:
    raw = run.raw()
    raw.send(command(1, "pause mk") + command(2, "land")[:-9])
    raw.close()
    run.until_refused(CUT_OFF, 1)
    with run.client() as anna:
        anna.state()
    assert spoken(run) == ["pause mk"]


def test_who_sends_and_stops_sending_is_answered(run: Served) -> None:
    with closing(run.raw()) as raw:
        raw.send(command(1, "land"))
        raw.socket.shutdown(socket.SHUT_WR)
        assert raw.read() == {"id": 1, "accepted": True, "reason": ""}
        assert raw.read() is None


def test_what_can_not_be_read_is_answered_and_counted(run: Served) -> None:
    bad = (b"{\n", b"\xff\xfe\n", b"[" * 5000 + b"\n", b"x" * LONGEST_LINE * 3 + b"\n")
    with closing(run.raw()) as raw:
        for line in bad:
            assert raw.send(line).read()["accepted"] is False
        assert raw.send(command(5, "land")).read()["accepted"] is True
    assert run.server.refused == {UNREADABLE: len(bad)}
    until(lambda: run.told, "the event")
    assert run.told == [f"1 {UNREADABLE}"]


def test_a_crowd_is_refused_and_counted_and_the_others_are_heard(run: Served) -> None:
    with run.client("anna") as anna:
        crowd = [run.raw().send(question(1, "state")) for _ in range(MOST_CLIENTS - 1)]
        assert all(raw.read()["id"] == 1 for raw in crowd)
        with run.client("ben") as ben:
            with pytest.raises(CommandRefused, match=f"beyond the {MOST_CLIENTS}"):
                ben.switch("mk", "down")
            assert ben.land() == ben.pause() == ben.stop() == Answer(True)
            crowd.pop().close()
            until(lambda: _is_heard(ben), "room for ben")
        assert anna.land() == Answer(True)
        for raw in crowd:
            raw.close()
    assert run.given[0].by == "ben"


def _is_heard(client: RunClient) -> bool:
    try:
        return bool(client.state())
    except CommandRefused:
        return False


def test_guests_make_room_for_others_who_would_land_it(
    run: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MOST_CLIENTS", 1)
    with run.client("anna") as anna:
        assert anna.state()
        guests = [run.raw() for _ in range(MOST_RESTRICTED)]
        with pytest.raises(CommandRefused, match="clients beyond"):
            run.client("ben").land()
        monkeypatch.setattr(server, "IDLE_CLIENT", 0.0)
        with run.client("ben") as ben:
            assert ben.land() == Answer(True)
        assert guests[0].read() is None
        for guest in guests:
            guest.close()


def test_what_was_refused_last_is_told_when_the_run_ends(run: Served) -> None:
    [unreported] = run.queue.last_words
    assert unreported() == ""
    raw = run.raw()
    for _ in range(2):
        raw.send(b"no json\n").read()
        until(lambda: run.server.has_unreported or run.told, "the refusal")
    until(lambda: run.told, "the first")
    assert unreported() == f"1 {UNREADABLE}"
    assert unreported() == ""
    raw.close()


def test_clients_that_say_nothing_make_room(run: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "IDLE_CLIENT", 0.0)
    crowd = [run.raw() for _ in range(MOST_CLIENTS)]
    with run.client("anna") as anna:
        assert anna.land() == Answer(True)
    assert crowd[0].read() is None
    for raw in crowd:
        raw.close()


def test_who_does_not_read_is_let_go(run: Served) -> None:
    with closing(run.raw()) as raw:
        raw.send(question(1, "watch"))
        raw.read()
        big = Event(0, "logged", "", {"text": "x" * 50_000})
        deadline = time.monotonic() + 60
        while not run.server.refused[SLOW_READERS] and time.monotonic() < deadline:
            run.server.on_event(big)
            time.sleep(0.0005)
    assert run.server.refused == {SLOW_READERS: 1}


def test_who_asks_without_reading_waits_and_takes_no_room(run: Served) -> None:
    with closing(run.raw()) as raw:
        raw.socket.setblocking(False)
        sent, line = 0, question(1, "state") * 100
        deadline = time.monotonic() + 0.5
        while time.monotonic() < deadline:
            try:
                sent += raw.socket.send(line)
            except BlockingIOError:
                time.sleep(0.01)
        with run.client() as anna:
            assert anna.land() == Answer(True)
    assert sent < 2_000_000


def test_commands_that_wait_for_the_tick_are_answered_when_the_run_is_over(stopped: Served) -> None:
    with closing(stopped.raw()) as raw:
        raw.send(command(1, "land") + question(2, "state"))
        until(lambda: len(stopped.queue.waiting) == 2, "both")
        stopped.queue.close()
        said = {raw.read()["id"]: "over" for _ in range(2)}
    assert said == {1: "over", 2: "over"}


def test_a_client_has_few_requests_in_the_queue(stopped: Served) -> None:
    with closing(stopped.raw()) as raw:
        raw.send(b"".join(command(k, "land") for k in range(100)))
        until(lambda: len(stopped.queue.waiting) == 8, "the first")
        time.sleep(0.05)
        assert len(stopped.queue.waiting) == 8
        answered = 0
        while answered < 100:
            stopped.tick()
            raw.socket.settimeout(0.02)
            try:
                answered += raw.socket.recv(1 << 16).count(b"\n")
            except TimeoutError:
                continue
    assert spoken(stopped) == ["land"] * 100


STRANGER = """
import os, socket, sys
os.setgid(65534); os.setuid(65534)
one = socket.socket(socket.AF_UNIX)
try:
    one.connect(sys.argv[1])
    one.sendall(b'{"id": 1, "command": "stop"}\\n')
except PermissionError:
    sys.exit("no entry")
except BrokenPipeError:
    pass
print(one.recv(1000).decode(), end="")
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user")
def test_another_users_process_is_refused_twice(run: Served) -> None:
    words = [sys.executable, "-I", "-S", "-c", STRANGER, str(run.path)]
    tried = subprocess.run(words, capture_output=True, text=True, check=False)
    assert tried.stderr == "no entry\n"
    run.path.chmod(0o777)
    for folder in (run.path.parent, run.path.parent.parent):
        folder.chmod(0o755)
    tried = subprocess.run(words, capture_output=True, text=True, check=False)
    assert OTHER_USERS in tried.stdout
    assert run.server.refused == {OTHER_USERS: 1}
    assert run.given == []


def test_nothing_is_left_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    with served(monkeypatch.setenv) as run:
        assert (run.folder / "control.json").exists()
        path, folder = run.path, run.folder
        threads = {thread.name for thread in threading.enumerate()}
        assert "commands" in threads
        anna = connect(folder, "anna")
    assert not path.exists()
    assert "commands" not in {thread.name for thread in threading.enumerate()}
    with pytest.raises(RunUnreachable, match="the run is over"):
        anna.land()
    anna.close()


def test_a_run_folder_that_can_not_be_written_is_told_and_the_run_is_served(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def read_only(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(server, "write_address", read_only)
    with served(monkeypatch.setenv) as run:
        with connect("eight") as anna:
            assert anna.land() == Answer(True)
        [said] = run.failed
    assert said == f"`{run.folder}/control.json` can't be written: Read-only file system"


def test_a_failing_server_is_told_and_ends(run: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "LINES", "many")
    with pytest.raises(RunUnreachable, match="the run is over"):
        run.client()
    until(lambda: run.failed, "the event")
    assert run.failed[0].startswith("TypeError: ")
    with pytest.raises(RunUnreachable, match="no run answers"):
        run.client()


def test_an_unwatched_server_keeps_no_events() -> None:
    served = CommandServer()
    for _ in range(3):
        served.on_event(Event(0, "landed", "mk", {}))
    assert list(served.events()) == []


def test_the_answer_is_the_ticks(stopped: Served) -> None:
    with closing(stopped.raw()) as raw:
        raw.send(command(4, "emit operator.go"))
        until(lambda: stopped.queue.waiting, "it")
        given = stopped.queue.waiting.popleft()
        assert given.order == Emit("operator.go")
        given.answered(Answer(False, "nobody\nlistens"))
        assert raw.read() == {"id": 4, "accepted": False, "reason": "nobody\nlistens"}
