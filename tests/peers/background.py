"""Runs a command in the background of a terminal that stops background writes, brings it to the front after a second and
types a line for it. Prints what the terminal shows and the processor time that the command took, and ends as it did.

    python3 background.py LINE COMMAND...
"""

import os
import pty
import signal
import sys
import termios
import time

pid, terminal = pty.fork()
if pid:
    # What the terminal shows; it ends with an error when its last process has gone.
    time_out = time.monotonic() + 30
    shown = b""
    try:
        while time.monotonic() < time_out:
            data = os.read(terminal, 4096)
            shown += data
            if b"READY" in data:
                os.write(terminal, sys.argv[1].encode() + b"\n")
    except OSError:
        pass
    sys.stdout.write(shown.decode().replace("\r", ""))
    sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))

mode = termios.tcgetattr(0)
mode[3] = (mode[3] | termios.TOSTOP) & ~termios.ECHO
termios.tcsetattr(0, termios.TCSANOW, mode)
child = os.fork()
if child == 0:
    os.setpgid(0, 0)
    time.sleep(0.2)
    os.execvp(sys.argv[2], sys.argv[2:])
time.sleep(1.5)
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
state = os.waitpid(child, os.WNOHANG | os.WUNTRACED)
if state != (0, 0):
    print(f"it has ended or is suspended: {state}")
    os._exit(99)
used = sum(float(ticks) for ticks in open(f"/proc/{child}/stat").read().rsplit(") ", 1)[1].split()[11:13])
print(f"processor: {used / os.sysconf('SC_CLK_TCK'):.2f} s")
os.tcsetpgrp(0, child)
print("READY", flush=True)
status = os.waitpid(child, 0)[1]
os._exit(os.waitstatus_to_exitcode(status))
