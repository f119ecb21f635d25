"""Photos of all kinds: decoding, orientation, colour."""
