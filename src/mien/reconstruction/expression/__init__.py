"""Expressions of a person whose neutral head is known: cameras, shape and what explains it.

The neutral head is the prior. What its face units can express comes first, with the cameras, since
the two are found together; what they leave is a smooth movement of the skin on top. One photo is
enough. Everything stays in the neutral head's frame and scale (docs/method/expressions.md).
"""
