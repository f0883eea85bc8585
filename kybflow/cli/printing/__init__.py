"""Formats what the commands print for people."""
