"""Renders images of tags, obstacles and parcels for simulated cameras."""
