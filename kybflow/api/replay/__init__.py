"""Flies the measurements of a recorded run again, without its devices: `tape` gives them out tick
by tick, and `replay` compares what is decided with what was decided. `kybflow replay` and scripts
use `replay` alone."""
