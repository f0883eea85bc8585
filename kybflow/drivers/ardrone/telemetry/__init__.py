"""A drone's status and its measurements, in SI, ENU, FLU and the run's time."""
