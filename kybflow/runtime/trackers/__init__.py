"""Trackers: from a setpoint to a command, one control law a file. The catalog finds them; a
vehicle's control calls the one that the mission or the target names."""
