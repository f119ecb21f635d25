"""Builds what ships in `src/mien/assets/data` from published packages."""
