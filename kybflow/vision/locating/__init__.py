"""Corners of tags to where the camera is."""
