"""Timelines as JSON, and performances for other programs."""
