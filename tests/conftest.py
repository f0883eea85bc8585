"""Makes the helpers beside the tests importable, and hypothesis draw the same in every run."""

import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))

settings.register_profile("seeded", derandomize=True, database=None, deadline=None)
settings.load_profile("seeded")
