"""What a drone says: its status, and measurements in SI, ENU and FLU, in the run's time."""
