"""The sink of a pass: what is reported there, and when it ends a compilation."""

from __future__ import annotations

import pytest

from kybflow.dsl.diagnostics import (
    Diagnostic,
    Findings,
    Severity,
    Span,
    Stopped,
)

HERE = Span("m.yaml", 1, 1, 1, 2)
ERROR = Diagnostic("KYB101", "an error", HERE, help="mend it")
WARNING = Diagnostic("KYB112", "a warning", HERE, severity=Severity.WARNING)


def test_what_is_reported_is_kept_in_order() -> None:
    found = Findings()
    found.warn("KYB112", "a warning", HERE)
    found.report("KYB101", "an error", HERE, help="mend it")
    found.add(WARNING)
    found.add([ERROR, WARNING])
    assert found.all == [WARNING, ERROR, WARNING, ERROR, WARNING]


def test_errors_stop_a_compilation_and_warnings_do_not() -> None:
    found = Findings()
    found.add(WARNING)
    found.stop_if_errors()
    found.add(ERROR)
    with pytest.raises(Stopped):
        found.stop_if_errors()
