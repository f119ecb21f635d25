"""Files: everything that mien reads and writes.

`load_` reads and `save_` writes, whole or not at all; `export_head` is for other programs.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
