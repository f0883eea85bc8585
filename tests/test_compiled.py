"""A wheel built with `HATCH_BUILD_HOOK_ENABLE_MYPYC=true` flies as the plain one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FLY = """
import sys
from pathlib import Path
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.vehicle import vehicle
from kybflow.api.flight import RunRequest, fly

plan = compile_mission(Path(sys.argv[1]), catalog=load_catalog()).plan
print(Path(vehicle.__file__).suffix)
request = RunRequest(seed=3, out=Path(sys.argv[2]))
fly(plan, request, (lambda e: print(e.time, e.name, e.fields),), ())
"""


def flown(package: Path, out: Path) -> list[str]:
    mission = ROOT / "missions" / "fallback.yaml"
    told = subprocess.run(
        [sys.executable, "-c", FLY, str(mission), str(out)],
        env={**os.environ, "PYTHONPATH": str(package)},
        cwd=out.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    return told.stdout.splitlines()


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_compiled_wheel_gives_the_same_events(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "compiled"
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(".git", "build", "*.so", "runs"))
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target)]
    environment = {**os.environ, "HATCH_BUILD_HOOK_ENABLE_MYPYC": "true"}
    subprocess.run([*command, str(source)], env=environment, check=True)

    compiled, plain = flown(target, tmp_path / "a"), flown(ROOT, tmp_path / "b")

    assert (compiled[0], plain[0]) == (".so", ".py")
    assert len(plain) > 10
    assert compiled[1:] == plain[1:]
