"""Which pictures become examples, their points and their exposure."""
