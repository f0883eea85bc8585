"""Supervisors: each raises an alarm while a vehicle flies, one a file. They report and do not act:
the failsafe decides. The catalog finds them."""
