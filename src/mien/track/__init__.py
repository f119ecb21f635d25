"""The performance in a video, by analysis and synthesis ([Pighin 2002] sec. 6)."""
