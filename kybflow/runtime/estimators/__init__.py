"""Estimators: from measurements to the state of a vehicle, one a file. None reads a simulator's
truth. The catalog finds them; a vehicle's estimation runs them and picks the first healthy one."""
