"""The examples in the help of a command are command lines."""

from __future__ import annotations

import re
import shlex
from typing import Any

import pytest
from command_lines import commands

HELPS = {" ".join(names): (names, command) for names, command in commands()}


@pytest.mark.parametrize("name", HELPS)
def test_an_example_is_a_command(name: str) -> None:
    names, command = HELPS[name]
    examples = re.findall(r"^ +kybflow ([^\n>]+)", command.help, re.MULTILINE)
    assert examples
    for line in examples:
        words = shlex.split(line)
        assert tuple(words[: len(names)]) == names
        given: Any = command.make_context(name, words[len(names) :])
        assert {param.name for param in command.params} == set(given.params)
