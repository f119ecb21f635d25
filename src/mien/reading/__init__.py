"""Strict readers of untrusted files: sizes, types and values are checked."""
