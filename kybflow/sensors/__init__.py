"""The sensors that are no part of a vehicle's driver, one a file or folder; its name is the YAML
name."""
