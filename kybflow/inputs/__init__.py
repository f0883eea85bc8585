"""Inputs: one part a file, and how what they say is written in rows. Opened by the API alone."""
