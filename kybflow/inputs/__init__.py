"""Inputs, one part a file, and the rows in which they are recorded. Only the API opens inputs."""
