"""Input devices, one part per file, and the rows in which their readings are recorded. Only the API
opens inputs."""
