"""Runs a command on a terminal of its own that nobody reads, and ends as the command did."""

import os
import pty
import subprocess
import sys

ours, theirs = pty.openpty()
child = subprocess.Popen(sys.argv[1:], stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True)
os.close(theirs)
sys.exit(child.wait())
