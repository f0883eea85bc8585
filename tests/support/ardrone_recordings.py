"""The recordings of a real drone that the npm package `ar-drone` has in its tests; fetched once a
machine where npm is at hand, and never kept in this repository."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest

PACKAGE = "ar-drone@0.3.3"
HOME = Path(tempfile.gettempdir()) / "kybflow-npm-ar-drone-0.3.3"


@cache
def package() -> Path:
    """The folder of the package; skips the test where it can't be had."""
    found = HOME / "node_modules" / "ar-drone"
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("npm is not installed")
    if not (found / "package.json").exists():
        _install(npm)
    return found


def _install(npm: str) -> None:
    """Install it aside and move it into place whole, for several processes may do so."""
    with tempfile.TemporaryDirectory(dir=HOME.parent) as name:
        aside = Path(name) / "package"
        asked = [npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", str(aside)]
        done = subprocess.run([*asked, PACKAGE], capture_output=True, text=True, check=False)
        if done.returncode or not (aside / "node_modules" / "ar-drone").exists():
            pytest.skip(f"npm can't install {PACKAGE}: {done.stderr.strip()[:200]}")
        with suppress(OSError):  # another process was sooner
            aside.rename(HOME)


def recording(name: str) -> bytes:
    """A file of its fixtures."""
    return (package() / "test" / "fixtures" / name).read_bytes()


def parsed_by_npm(path: Path) -> dict:
    """What the package's own parser reads of a datagram in a file."""
    script = (
        "const parse=require(process.argv[1]+'/lib/navdata/parseNavdata');"
        "const data=require('fs').readFileSync(process.argv[2]);"
        "console.log(JSON.stringify(parse(data)))"
    )
    command = ["node", "--no-deprecation", "-e", script, str(package()), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)
