"""The sensors that don't belong to a vehicle's driver. Each file or folder is named as the sensor
in YAML."""
