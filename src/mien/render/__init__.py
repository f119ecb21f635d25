"""Pictures of a head.

`render_head` draws one; a `HeadRenderer` prepares a head once for many.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
