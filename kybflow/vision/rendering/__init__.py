"""Images of tags as a simulated camera sees them."""
