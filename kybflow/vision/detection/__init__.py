"""Images to the corners of tags."""
