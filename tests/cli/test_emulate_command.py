"""`kybflow emulate autopilot` says what is wrong with its command line."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from toolchain import invoke

from kybflow.drivers.emulated_autopilot.state import AutopilotFailures
from kybflow.drivers.emulation.breaking import read_break


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fail", "nothing"], "can fail"),
        (["--param", "COM_OBL_RC_ACT"], "is not NAME=VALUE"),
        (["--param", "COM_OBL_RC=0"], "no parameter COM_OBL_RC; did you mean `COM_OBL_RC_ACT`?"),
        (["--airframe", "zeppelin"], "no airframe `zeppelin`"),
        (["--address", "udp:1"], "could mean two things"),
        (["--address", "tcpin:1"] * 2, "can't listen"),
        (["--factory", "--no-gps"], "leave out --no-gps"),
    ],
)
def test_a_wrong_command_line_is_told(arguments, words):
    found = invoke("emulate", "autopilot", "--vehicle", "px4", *arguments)
    assert found.exit_code in (2, 3)
    assert words in " ".join(found.output.replace("│", " ").split())


def test_what_fails_is_said_as_it_was_written():
    written = ("deaf", "pilot=POSCTL", "battery=0.06")
    assert [str(read_break(f"{text}@20", AutopilotFailures)) for text in written] == list(written)
