"""The performance in a video, by analysis and synthesis (P02 sec. 6)."""
