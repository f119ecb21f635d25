"""The parts of tracking a video: preparation, the run, its outputs."""
