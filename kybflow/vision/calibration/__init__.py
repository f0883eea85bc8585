"""Calibration of the lens, the mount and the map from recorded frames of a walk over the tags: the
equations (`model`), their solution (`adjust`), and the detection of tags in the frames (`walk`)."""
