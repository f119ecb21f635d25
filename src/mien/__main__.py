"""`python -m mien` is `mien`."""

import sys

from mien.app.cli import main

sys.exit(main())
