"""Least squares, quadratic programs, acceleration."""
