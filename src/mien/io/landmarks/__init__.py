"""Feature points as files, also of other programs."""
