"""`kybflow emulate ardrone` says what is wrong with its command line."""

from __future__ import annotations

import pytest
from toolchain import invoke


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--host", "192.168.1.1"], 3, "192.168.1.1 is not a loopback address"),
        (["--host", "drone"], 3, "`drone` is not an IPv4 address"),
        (["--fail", "nonsense"], 2, "nothing called `nonsense` can fail"),
        (["--loss", "2"], 2, "--loss"),
        (["--loss", "nan"], 2, "nan is not finite"),
    ],
)
def test_what_is_wrong_is_said(arguments, code, said):
    found = invoke("emulate", "ardrone", *arguments)
    assert (found.exit_code, said in found.output) == (code, True), found.output
