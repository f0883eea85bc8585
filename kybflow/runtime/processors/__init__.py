"""Processors: parts that may change a setpoint before it is tracked, one per file. The catalog
finds them; a vehicle's control calls them in the order of the mission."""
