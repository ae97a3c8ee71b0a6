"""A tactile pad on the other end of a link. It knows only the data sheets: it shares no code with the driver.

    python3 pad.py flexitac_16x32 pty|tcp|udp|ws [--path LINK]

It prints the address that a driver opens, and then does what it reads on the standard input, a line each, and answers
each with a line:

    go, pause               send frames, 10 ms apart, or nothing
    split N                 write each frame in pieces of N bytes
    marks none|moving|fixed put the marker into the payload
    press X Y               a grid shows a touch: X along its columns and Y along its rows, each from -1 to 1
    release                 a grid shows the noise of a pad that nobody touches
    raw HEX                 send bytes between two frames
    lose, add, flip         take a byte out of the next frame, put one in, or change one
    repeat N                send the next frame N times
    flood N                 send N random bytes at once
    half                    send half a frame and close the link
    close, open             unplug the pad, and plug it in again
    late                    exchange the next two datagrams
    foreign                 send a frame from another port
    seen                    answer with the bytes that the driver has sent
    frame                   answer with the next frame

The value of tactel k in frame n is (7 n + 3 k) mod 251.
"""

import base64
import hashlib
import os
import pty
import random
import select
import socket
import struct
import sys
import threading
import time
import tty


def value(n, k):
    return (7 * n + 3 * k) % 251


def cells(n, count, marks):
    """The values of a frame, with a marker in them."""
    found = [value(n, k) for k in range(count)]
    if marks != "none":
        place = 10 + (n * 37 % (count - 20) if marks == "moving" else 0)
        found[place : place + 2] = [0xAA, 0x55]
    return found


def touched(n, rows, cols, place):
    """Noise of one step around 10, and a touch of about two tactels around a place, if there is one."""
    found = [10 + (7 * n + 3 * k) % 2 for k in range(rows * cols)]
    if place is not None:
        x, y = (place[0] + 1) / 2 * (cols - 1), (place[1] + 1) / 2 * (rows - 1)
        for k in range(rows * cols):
            away = ((k % cols - x) ** 2 + (k // cols - y) ** 2) ** 0.5
            found[k] += round(100 * max(0.0, 1 - away / 2.5))
    return found


def grid(rows, cols):
    """FlexiTac: AA 55 and a byte for each tactel. `marks` is the place of a touch too, with None for no touch."""

    def packets(n, marks):
        is_touch = not isinstance(marks, str)
        found = touched(n, rows, cols, marks) if is_touch else cells(n, rows * cols, marks)
        return [b"\xaa\x55" + bytes(found)]

    return packets


def cushion(n, marks):
    return [b"\xaa\x55\x03\x99" + bytes(cells(n, 1024, marks))]


def mat(n, marks):
    """Eight packets: delimiter, number from 0 on, 128 values."""
    found = bytes(cells(n, 1024, marks))
    return [b"\xaa\x55\x03\x99" + bytes([i]) + found[128 * i : 128 * (i + 1)] for i in range(8)]


def glove(n, marks):
    """Two packets: delimiter, order, type 01 (left), 128 values; the second one has four floats more."""
    found = bytes(cells(n, 256, marks))
    head = b"\xaa\x55\x03\x99"
    return [head + b"\x01\x01" + found[:128], head + b"\x02\x01" + found[128:] + struct.pack("<4f", 1, 0, 0, 0)]


def anyskin(n, marks):
    """Five chips: temperature, x, y, z as floats; CR LF behind them. CR LF is the lower half of some floats too."""
    chips = [struct.pack("<4f", 24.5, 1.0, -2.0, value(n, k)) for k in range(5)]
    if marks != "none":
        chips[2] = chips[2][:4] + b"\x0d\x0a\x80\x3f" + chips[2][8:]
    return [b"".join(chips) + b"\r\n"]


def velostat_ascii(n, marks):
    return [",".join(str(v) for v in cells(n, 256, "none")).encode() + b"\r\n"]


def velostat_binary(n, marks):
    return [bytes(cells(n, 256, marks))]


MYRMEX = [[208, 224, 32, 0], [192, 48, 16, 64], [176, 144, 112, 80], [160, 240, 128, 96]]


def myrmex(n, marks):
    """F0 C4, id 01, a time of 32 bits, 256 words, XOR of all before. A word falls with the force."""
    words = [0] * 256
    for row in range(16):
        for col in range(16):
            word = MYRMEX[row % 4][col % 4] + 4 * (row // 4) + col // 4
            words[word] = (word % 16) << 12 | (4095 - value(n, 16 * row + col))
    frame = b"\xf0\xc4\x01" + struct.pack("<I", (n * 4000) % 2**32) + struct.pack("<256H", *words)
    xor = 0
    for byte in frame:
        xor ^= byte
    return [frame + bytes([xor])]


def counted(n, marks):
    """A datagram: a counter of 16 bits with the high byte first, and 16 values."""
    return [struct.pack(">H", n % 2**16) + bytes(cells(n, 16, "none"))]


PADS = {
    "flexitac_16x32": grid(16, 32),
    "flexitac_16x16": grid(16, 16),
    "flexitac_12x32": grid(12, 32),
    "aa550399_32x32": cushion,
    "aa550399_glove": glove,
    "mat_in_parts": mat,
    "anyskin": anyskin,
    "velostat_ascii": velostat_ascii,
    "velostat_binary": velostat_binary,
    "myrmex_v2": myrmex,
    "counted": counted,
}


class Pty:
    def __init__(self, path):
        self.path, self.master = path, None
        self.open()

    def open(self):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        name, new = os.ttyname(self.slave), self.path + ".new"
        os.symlink(name, new)
        os.replace(new, self.path)
        self.address = "serial:" + self.path

    def send(self, data):
        """Sends bytes. What nobody reads for a second is lost, as on a wire."""
        end = time.monotonic() + 1.0
        while data and self.master is not None and time.monotonic() < end:
            try:
                data = data[os.write(self.master, data) :]
            except BlockingIOError:
                select.select([], [self.master], [], 0.1)

    def read(self):
        if self.master is None or not select.select([self.master], [], [], 0)[0]:
            return b""
        try:
            return os.read(self.master, 4096)
        except OSError:
            return b""

    def close(self):
        if self.master is not None:
            os.unlink(self.path)
            os.close(self.slave)
            os.close(self.master)
            self.master = None


class Tcp:
    def __init__(self, path):
        self.server, self.peer, self.port = None, None, 0
        self.open()

    def open(self):
        self.server = socket.create_server(("127.0.0.1", self.port))
        self.server.setblocking(False)
        self.port = self.server.getsockname()[1]
        self.address = f"tcp:127.0.0.1:{self.port}"

    def accept(self):
        if self.peer is None and self.server is not None:
            try:
                self.peer, _ = self.server.accept()
                self.peer.setblocking(True)
                self.peer.settimeout(1.0)
                self.greet()
            except (BlockingIOError, OSError):
                self.peer = None

    def greet(self):
        pass

    def send(self, data):
        self.accept()
        try:
            if self.peer:
                self.peer.sendall(self.packed(data))
        except OSError:
            self.peer = None

    @staticmethod
    def packed(data):
        return data

    def read(self):
        self.accept()
        try:
            if self.peer and select.select([self.peer], [], [], 0)[0]:
                data = self.peer.recv(4096)
                if data:
                    return data
                self.peer = None
        except OSError:
            self.peer = None
        return b""

    def close(self):
        for it in (self.peer, self.server):
            if it is not None:
                it.close()
        self.peer, self.server = None, None


class WebSocket(Tcp):
    """RFC 6455, one binary message for each call of `send`."""

    def open(self):
        super().open()
        self.address = f"ws:127.0.0.1:{self.port}/pad"

    def greet(self):
        request = b""
        while b"\r\n\r\n" not in request:
            request += self.peer.recv(4096)
        key = next(line.split(b":")[1].strip() for line in request.split(b"\r\n") if line.lower().startswith(b"sec-websocket-key"))
        accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
        self.peer.sendall(
            b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n"
        )

    @staticmethod
    def packed(data):
        length = len(data)
        return b"\x82" + (bytes([length]) if length < 126 else b"\x7e" + struct.pack(">H", length)) + data


class Udp:
    """It sends to the address that has sent `start`."""

    def __init__(self, path):
        self.socket, self.other = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.socket.bind(("127.0.0.1", 0))
        self.other.bind(("127.0.0.1", 0))
        self.peer, self.held = None, None
        self.is_late = False
        self.address = f"udp:127.0.0.1:{self.socket.getsockname()[1]}"

    def send(self, data):
        if self.is_late and self.held is None:
            self.held = data
            return
        if self.peer:
            self.socket.sendto(data, self.peer)
            if self.held is not None:
                self.socket.sendto(self.held, self.peer)
                self.held, self.is_late = None, False

    def read(self):
        if not select.select([self.socket], [], [], 0)[0]:
            return b""
        data, self.peer = self.socket.recvfrom(4096)
        return data

    def close(self):
        pass


class Pad:
    def __init__(self, name, link, path):
        self.name, self.make = name, PADS[name]
        self.link = {"pty": Pty, "tcp": Tcp, "udp": Udp, "ws": WebSocket}[link](path)
        self.lock, self.random = threading.Lock(), random.Random(1)
        self.n, self.is_going, self.pieces, self.marks = 0, False, 0, "none"
        self.harm, self.times, self.seen = None, 1, b""
        # What the pad waits for before it sends.
        self.starts = {"myrmex_v2": bytes.fromhex("F0C400F1C5")}.get(name, b"")
        self.stops = {"myrmex_v2": bytes.fromhex("F0C4000034")}.get(name, b"")
        self.is_started, self.asked = not self.starts, 0
        self.is_over = False

    def hear(self):
        data = self.link.read()
        self.seen += data
        self.asked += data.count(b"A")
        if self.starts and self.starts in data:
            self.is_started = True
        if self.stops and self.stops in data:
            self.is_started = False

    def put(self, data):
        if not self.pieces:
            self.link.send(data)
            return
        for start in range(0, len(data), self.pieces):
            self.link.send(data[start : start + self.pieces])

    def frame(self):
        packets = self.make(self.n, self.marks)
        self.n += 1
        data = bytearray(packets[0])
        middle = len(data) // 2
        if self.harm == "lose":
            del data[middle]
        elif self.harm == "add":
            data.insert(middle, 0x33)
        elif self.harm == "flip":
            data[middle] ^= 0x21
        self.harm = None
        return [bytes(data)] + packets[1:]

    def run(self):
        while not self.is_over:
            with self.lock:
                self.hear()
                is_due = self.is_going and self.is_started
                if self.name == "velostat_binary":
                    is_due, self.asked = is_due and self.asked > 0, 0
                if is_due:
                    packets = self.frame()
                    for _ in range(self.times):
                        for packet in packets:
                            self.put(packet)
                    self.times = 1
            time.sleep(0.002 if self.name == "velostat_binary" else 0.01)

    def do(self, line):
        word, *rest = line.split()
        with self.lock:
            if word in ("go", "pause"):
                self.is_going = word == "go"
            elif word == "split":
                self.pieces = int(rest[0])
            elif word == "marks":
                self.marks = rest[0]
            elif word == "press":
                self.marks = (float(rest[0]), float(rest[1]))
            elif word == "release":
                self.marks = None
            elif word == "raw":
                self.link.send(bytes.fromhex(rest[0]))
            elif word in ("lose", "add", "flip"):
                self.harm = word
            elif word == "repeat":
                self.times = int(rest[0])
            elif word == "flood":
                self.link.send(self.random.randbytes(int(rest[0])))
            elif word == "half":
                data = self.frame()[0]
                self.link.send(data[: len(data) // 2])
                time.sleep(0.05)
                self.link.close()
            elif word == "close":
                self.link.close()
            elif word == "open":
                self.link.open()
                self.is_started = not self.starts
            elif word == "late":
                self.link.is_late = True
            elif word == "foreign":
                self.link.other.sendto(self.make(200, "none")[0], self.link.peer)
            elif word == "seen":
                self.hear()
                return self.seen.hex() or "-"
            elif word == "frame":
                return self.make(self.n, self.marks)[0].hex()
            else:
                return "what?"
        return "ok"


def main():
    name, link = sys.argv[1:3]
    path = sys.argv[4] if len(sys.argv) > 4 else ""
    pad = Pad(name, link, path)
    print(pad.link.address, flush=True)
    thread = threading.Thread(target=pad.run)
    thread.start()
    for line in sys.stdin:
        print(pad.do(line), flush=True)
    pad.is_over = True
    thread.join()
    pad.link.close()


main()
