"""Runs a command on a terminal of its own, prints what that terminal was sent, and ends as the command did."""

import os
import pty
import sys

sys.exit(os.waitstatus_to_exitcode(pty.spawn(sys.argv[1:])))
