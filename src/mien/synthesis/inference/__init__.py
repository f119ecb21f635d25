"""From feature points to coefficients: all points from some, mixtures, checks."""
