"""Calibration of lens, mount and map from recorded frames of a walk over the tags: the equations
(`model`), their solution (`adjust`), and the detection of tags in the frames (`walk`)."""
