"""A program that speaks the protocol of docs/processes.md by itself, and then does one thing wrong.

It uses nothing of the Python package, so it is also the second implementation of the protocol.
"""

import json
import os
import struct
import subprocess
import sys
import time

HEADER = struct.Struct("<4sIQq")
SIGNATURE = {
    "tactflow": 1,
    "name": "broken",
    "inputs": [{"name": "image", "kind": "image"}],
    "outputs": [{"name": "sum", "kind": "scalar", "unit": "N"}],
    "params": [{"name": "gain", "default": 1.0}],
}


def say(data: bytes) -> None:
    os.write(1, data)


def read(count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = os.read(0, count - len(data))
        if not more:
            sys.exit(0)
        data += more
    return data


def line() -> dict:
    data = b""
    while not data.endswith(b"\n"):
        data += read(1)
    return json.loads(data)


def answer(number: int, stamp: int, value: float) -> bytes:
    body = b"\1" + struct.pack("<d", value)
    return HEADER.pack(b"TFLO", len(body), number, stamp) + body


def main(wrong: str, after: int) -> None:
    signature = dict(SIGNATURE)
    if wrong == "version":
        signature["tactflow"] = 2
    if wrong == "port":
        signature["outputs"] = [{"name": "total", "kind": "scalar", "unit": "N"}]
    if wrong == "unit":
        signature["outputs"] = [{"name": "sum", "kind": "scalar", "unit": "kPa"}]
    if wrong == "silent":
        time.sleep(600)
    if wrong == "no_module":
        import no_such_module  # noqa: F401
    if wrong == "chatty":
        say(b"Loading the model\n")
    say(json.dumps(signature).encode() + b"\n")
    if wrong == "deaf":
        time.sleep(600)
    start = line()
    gain = start["params"]["gain"]
    if wrong == "grandchild":
        child = subprocess.Popen(["sleep", "600"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        with open(sys.argv[3], "w") as file:
            file.write(f"{os.getpid()} {child.pid}")
    asked = 0
    while True:
        mark, length, number, stamp = HEADER.unpack(read(HEADER.size))
        assert mark == b"TFLO"
        body = read(length)
        state, _, rows, cols = struct.unpack_from("<BqII", body)
        assert state and length == 17 + 4 * rows * cols
        total = gain * sum(struct.unpack_from(f"<{rows * cols}f", body, 17))
        asked += 1
        if asked < after:
            say(answer(number, stamp, total))
            continue
        if wrong == "crash":
            raise ZeroDivisionError("the mean of nothing")
        if wrong == "killed":
            os.kill(os.getpid(), 9)
        if wrong == "hang":
            time.sleep(600)
        if wrong == "slow":
            time.sleep(0.15)
        if wrong == "flood":
            say(answer(number, stamp, total) * 100)
            continue
        if wrong == "size":
            say(HEADER.pack(b"TFLO", 5, number, stamp) + b"\1" + bytes(4))
        elif wrong == "huge":
            say(HEADER.pack(b"TFLO", 1 << 31, number, stamp))
        elif wrong == "nan":
            say(answer(number, stamp, float("nan")))
        elif wrong == "garbage":
            say(bytes(range(128, 168)))
        elif wrong == "print":
            say(b"x is 0.123456789 and y is 5\n")
        elif wrong == "number":
            say(answer(number + 7, stamp, total))
        elif wrong == "stamp":
            say(answer(number, stamp + 1, total))
        elif wrong == "half":
            say(answer(number, stamp, total)[:30])
            sys.exit(0)
        else:
            say(answer(number, stamp, total))


main(sys.argv[1], int(sys.argv[2]))
