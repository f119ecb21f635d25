"""Expressions from feature points: examples mixed by geometry ([Zhang 2006]).

`gather_examples` finds examples in a video or in photos of a person; a `Synthesizer` draws from
them an expression that is given by its feature points, or by a few of them. A `HeadSynthesizer`
does the same with the photographed expressions of a head.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
