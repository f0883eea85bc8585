"""Trackers: control laws that turn a setpoint into a command, one per file. The catalog finds them;
a vehicle's control calls the tracker that the mission or the target names."""
