"""The tutorial, done as written, in an empty folder: its files, its commands, what they print.

A fence ```yaml NAME holds a whole file; ```console holds commands (`$ ...`) and their output, in
which `...` stands for any text, and on a line of its own for any lines; `$ ...  # ends with 2` says
how the command ends when that is not 0."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from toolchain import ROOT, program

TUTORIAL = ROOT / "docs" / "tutorial.md"
FENCE = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ENDS = re.compile(r"\s+# ends with (\d+)$")


def steps() -> Iterator[tuple[str, str, str]]:
    for match in FENCE.finditer(TUTORIAL.read_text(encoding="utf-8")):
        yield match[1], match[2] or "", match[3]


def commands(text: str) -> Iterator[tuple[str, int, str]]:
    """Each command of a console block, how it ends, and what it prints."""
    for block in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        line, _, output = block.partition("\n")
        ends = ENDS.search(line)
        yield ENDS.sub("", line), int(ends[1]) if ends else 0, output


def pattern(output: str) -> re.Pattern[str]:
    return re.compile("".join(map(_line, output.rstrip("\n").splitlines())))


def _line(line: str) -> str:
    if line.strip() == "...":
        return r"(?:.*\n)*?"
    return re.escape(line).replace(r"\.\.\.", ".*") + r"\s*\n"


@pytest.mark.thorough
def test_the_tutorial_is_true(tmp_path: Path):
    wrong = []
    for language, name, text in steps():
        if language == "yaml" and name:
            (tmp_path / name).write_text(text, encoding="utf-8")
        if language != "console":
            continue
        for command, code, output in commands(text):
            done = ran(command, tmp_path)
            said = done.stdout + done.stderr
            if done.returncode != code or (output and not pattern(output).fullmatch(said)):
                wrong.append((command, done.returncode, said))
    assert wrong == []


def test_the_tutorial_has_commands():
    consoles = [text for language, _, text in steps() if language == "console"]
    assert sum(len(list(commands(text))) for text in consoles) >= 8


def ran(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    name, *arguments = command.split()
    assert name == "kybflow"
    return program(*arguments, cwd=folder, COLUMNS="120")
