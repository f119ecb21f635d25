"""Data that ships with mien: the generic head, the feature points, the subregions, the detector."""
