"""Each verb of mien as a function: build, track, live, animate, examples, synthesize, demo."""
