"""`python -m magfem` is the command `magfem`."""

import sys

from magfem.cli import main

sys.exit(main())
