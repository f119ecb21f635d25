"""The example folder."""
