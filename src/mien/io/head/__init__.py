"""The head folder."""
