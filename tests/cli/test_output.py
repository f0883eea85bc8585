"""Printing in flight: nobody who doesn't read is ever waited for."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import until

from kybflow.cli.output import UnwaitedStream, echo

MISSION = Path(__file__).parents[2] / "missions" / "first_flight.yaml"


def test_a_writer_goes_on_while_nobody_reads_a_full_pipe() -> None:
    reading, writing = os.pipe()
    with (
        open(writing, "w", encoding="utf-8") as stream,
        open(reading, "rb") as read,
        UnwaitedStream(stream) as out,
    ):
        for number in range(100_000):
            out.line(f"{number}")
        head = read.read(20)  # makes room: leaving waits until all is written
        os.set_blocking(reading, False)
        until(lambda: not (read.read() or out._waiting), "the rest is written")
    assert head.startswith(b"0\n1\n2\n")


def test_output_to_a_reader_who_left_is_dropped() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w", encoding="utf-8") as stream, UnwaitedStream(stream) as out:
        out.line("one")
        out.line("two")


def test_a_stream_without_a_descriptor_gets_everything_in_order() -> None:
    stream = io.StringIO()
    with UnwaitedStream(stream) as out:
        out.line("one")
        out.line("two")
    assert stream.getvalue() == "one\ntwo\n"


class Screen(io.StringIO):
    """A terminal that remembers what it shows."""

    def isatty(self) -> bool:
        return True


LINES = {
    "held    finally nano in landed": "\x1b[32mheld\x1b[0m    finally nano in landed",
    "FAILED  finally nano in landed": "\x1b[1;31mFAILED\x1b[0m  finally nano in landed",
    "RED    nano  link": "\x1b[1;31mRED\x1b[0m    nano  link",
    "hop succeeded": "\x1b[32mhop succeeded\x1b[0m",
    "hop FAILED: why": "\x1b[1;31mhop FAILED\x1b[0m: why",
    "hop interrupted: why": "\x1b[1;33mhop interrupted\x1b[0m: why",
    "a log that held FAILED [b]": "a log that held FAILED [b]",
}


@pytest.mark.parametrize("line", LINES)
def test_a_terminal_has_colours_unless_they_are_declined(line: str, monkeypatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr("sys.stdout", screen := Screen())
    echo(line)
    monkeypatch.setenv("NO_COLOR", "1")
    with UnwaitedStream(screen) as out:
        out.line(line)
    monkeypatch.setattr("sys.stdout", piped := io.StringIO())
    echo(line)
    assert screen.getvalue() == f"{LINES[line]}\n{line}\n"
    assert piped.getvalue() == f"{line}\n"


@pytest.mark.thorough
@pytest.mark.parametrize("words", [(), ("--plain",)])
def test_a_terminal_that_nobody_reads_does_not_stop_the_flight(words, tmp_path: Path) -> None:
    terminal, own = os.openpty()
    command = [sys.executable, "-m", "kybflow", "run", str(MISSION), "--no-report", *words]
    command += ["--out", str(tmp_path / "run"), "--speed", "2"]
    environment = {**os.environ, "TERM": "xterm"}
    filled = b"." * 3000  # so that little more fits into the terminal's buffer
    os.write(own, filled)
    with subprocess.Popen(command, stdout=own, stderr=own, env=environment) as program:
        summary = tmp_path / "run" / "summary.json"
        until(lambda: summary.exists() or program.poll() is not None, "the run ends")
        program.kill()
    os.close(terminal)
    os.close(own)
    assert json.loads(summary.read_text(encoding="utf-8"))["outcome"] == "succeeded"
