"""Images to the corners of tags, and these to where the camera is: finding, searching, solving, and
the locator that does all three."""
