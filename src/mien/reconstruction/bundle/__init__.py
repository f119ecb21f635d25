"""Bundle adjustment: all cameras and all points at once."""
