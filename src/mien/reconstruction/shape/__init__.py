"""The surface that the cameras and the observed points determine."""
