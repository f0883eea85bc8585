"""A drone's status and its measurements, in SI units, in the frames ENU and FLU, and in the run's
time."""
