"""The CPU time and memory of a script that reads one vehicle of a long run as arrays.

    python bench/reading.py [--minutes 30]

Four vehicles fly `missions/formation.yaml` once. Its chunks of messages are then written again and
again until the recording is as long as asked, so that times repeat. A new process reads it.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import kybflow
from kybflow.recording.run_folder import LOG

ROOT = Path(__file__).parent.parent
MAGIC = 8
"""Bytes before the first record."""
RECORD, CHUNK = struct.Struct("<BQ"), 6
"""The opcode and the length before each record, and the opcode of chunks."""
READ = """
import resource, sys, time
import kybflow
began = time.process_time()
run = kybflow.Run.load(sys.argv[1])
vehicle = run.vehicle(run.vehicles[0])
vehicle.error, vehicle.state
used, peak = time.process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(f"  {len(vehicle.time)} ticks, {used:.1f} s of CPU, at most {peak / 1024:.0f} MB")
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    minutes = parser.parse_args().minutes
    with tempfile.TemporaryDirectory() as folder:
        run = kybflow.run(ROOT / "missions" / "formation.yaml", out=Path(folder) / "run")
        log, at, chunks = (run.folder / LOG).read_bytes(), MAGIC, []
        while at + RECORD.size < len(log):
            opcode, length = RECORD.unpack_from(log, at)
            end = at + RECORD.size + length
            chunks += [log[at:end]] if opcode == CHUNK else []
            at = end
        head, times = log[: log.index(chunks[0])], minutes * 60.0 / run.summary["sim_time_s"]
        with (run.folder / LOG).open("wb") as file:
            file.write(head)
            for _ in range(round(times)):
                file.writelines(chunks)
            print(f"{len(run.vehicles)} vehicles, {minutes:g} min, {file.tell() / 1e6:.0f} MB")
        subprocess.run([sys.executable, "-c", READ, str(run.folder)], check=True)


if __name__ == "__main__":
    main()
