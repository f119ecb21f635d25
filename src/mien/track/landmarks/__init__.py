"""A starting pose from the detector's landmarks."""
