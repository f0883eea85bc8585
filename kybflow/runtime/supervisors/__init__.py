"""Supervisors: each checks one danger while a vehicle flies, and raises an alarm; one per file.
They only report: the failsafe decides on the reaction. The catalog finds them."""
