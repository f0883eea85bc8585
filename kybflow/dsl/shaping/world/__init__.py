"""The world of the document: fence, obstacles, printed tags and cameras."""
