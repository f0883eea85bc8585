"""The catalog tells what is wrong with a package that offers parts."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from kybflow.core.errors import PartError
from kybflow.parts import catalog
from kybflow.runtime.trackers import cascade


@pytest.mark.parametrize(
    ("body", "reason"), [("import no_such_thing", "no_such_thing"), ("1 / 0", "division by zero")]
)
def test_a_package_that_cannot_be_imported_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, reason: str
) -> None:
    name = "broken_lab_" + reason.replace(" ", "_")
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text(body)
    monkeypatch.syspath_prepend(tmp_path)
    entry = EntryPoint("lab", name, catalog.GROUP)
    monkeypatch.setattr(catalog, "entry_points", lambda group: [entry])
    with pytest.raises(PartError, match=f"{name}.*{reason}"):
        catalog._catalog.__wrapped__(())


def test_a_part_that_inherits_from_a_compiled_one_is_refused_before_it_flies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "derived_lab" / "trackers"
    home.mkdir(parents=True)
    for file in (home.parent / "__init__.py", home / "__init__.py"):
        file.touch()
    own = "from kybflow.runtime.trackers.cascade import Cascade\n"
    (home / "mine.py").write_text(f'"""Mine."""\n\n{own}\n\nclass Mine(Cascade): ...\n')
    monkeypatch.syspath_prepend(tmp_path)
    entry = EntryPoint("lab", "derived_lab", catalog.GROUP)
    monkeypatch.setattr(catalog, "entry_points", lambda group: [entry])
    offered = catalog._catalog.__wrapped__(())
    monkeypatch.setattr(cascade, "__file__", f"{cascade.__file__.removesuffix('py')}so")
    with pytest.raises(PartError, match="inherits from `Cascade`, which is compiled"):
        offered.get("trackers", "mine")
