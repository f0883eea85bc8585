"""Findings: what one is, how it is rendered, and what each code means."""
