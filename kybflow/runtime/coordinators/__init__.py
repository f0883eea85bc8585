"""Coordinators: laws over the vehicles that a phase of a flow runs, one per file. The catalog finds
them; the flow calls the coordinator of its phase."""
