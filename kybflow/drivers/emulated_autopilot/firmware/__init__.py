"""One file an emulated firmware, and what they have in common."""
