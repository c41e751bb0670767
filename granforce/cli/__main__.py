"""`python -m granforce.cli` is the command `granforce`."""

import sys

from granforce.cli.parser import main

sys.exit(main())
