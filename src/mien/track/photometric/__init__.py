"""Fitting the drawn head to a frame by its pixels."""
