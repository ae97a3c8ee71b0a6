"""Runs a command, reads its standard error slowly, and interrupts it; prints how long it then lived, and its code."""

import fcntl
import os
import signal
import subprocess
import sys
import time

child = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
fcntl.fcntl(child.stderr, fcntl.F_SETPIPE_SZ, 4096)
end = time.monotonic() + 1.5
while time.monotonic() < end:
    os.read(child.stderr.fileno(), 256)
    time.sleep(0.1)
child.send_signal(signal.SIGINT)
begin = time.monotonic()
while child.poll() is None:
    os.read(child.stderr.fileno(), 256)
    time.sleep(0.05)
print(f"{time.monotonic() - begin:.2f} {child.returncode}")
