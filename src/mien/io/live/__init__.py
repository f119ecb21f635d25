"""Live Link and VMC: files and packets."""
