"""The examples in the help of `kybflow mavlink`, `ardrone` and `emulate` are command lines."""

from __future__ import annotations

import re
import shlex

import click
import pytest

from kybflow.cli.app import app
from kybflow.cli.commands.ardrone import EXAMPLES as JOINING
from kybflow.cli.commands.emulate import EXAMPLES
from kybflow.cli.commands.mavlink import LISTEN, SETUP
from kybflow.cli.emulating.ardrone import EXAMPLES as DRONES

SHOWN = re.findall(r"kybflow [^\n]+", "\n".join((EXAMPLES, LISTEN, SETUP, JOINING, DRONES)))


def test_there_are_examples():
    assert len(SHOWN) >= 8


@pytest.mark.parametrize("line", SHOWN)
def test_an_example_is_a_command(line: str):
    _, group, name, *arguments = shlex.split(line)
    known = app.get_command(click.Context(app), group)
    assert isinstance(known, click.Group)
    assert known.commands[name].make_context(name, arguments).params
