"""`kybflow emulate autopilot` says what is wrong with its command line."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from kybflow.cli import app


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fail", "nothing"], "can fail"),
        (["--param", "COM_OBL_RC_ACT"], "is not NAME=VALUE"),
        (["--airframe", "zeppelin"], "no such airframe"),
        (["--address", "udp:1"], "could mean two things"),
        (["--address", "tcpin:1"] * 2, "can't listen"),
    ],
)
def test_a_wrong_command_line_is_told(arguments, words):
    found = CliRunner().invoke(app, ["emulate", "autopilot", "--vehicle", "px4", *arguments])
    assert found.exit_code in (2, 3)
    assert words in " ".join(found.output.replace("│", " ").split())
