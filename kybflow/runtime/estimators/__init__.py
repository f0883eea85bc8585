"""Estimators: they turn measurements into the state of a vehicle, one estimator per file. None
reads a simulator's ground truth. The catalog finds them; a vehicle's estimation runs them and
selects the first healthy one."""
