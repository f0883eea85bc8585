"""The sensors that don't belong to a vehicle's driver; a file or folder has the YAML name."""
