"""The face detector and its landmarks."""
