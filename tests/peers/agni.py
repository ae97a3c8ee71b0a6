"""A device of the AGNI serial protocol on a pseudo-terminal, written from the description of the protocol.

    agni.py LINK [--sensors 512,192] [--serial B012] [--help-text] [--period 0.005]

LINK becomes a symbolic link to the terminal. Each command of the host is printed as a line of JSON. Lines on the
standard input say what goes wrong next:

    split     every byte is a write of its own       whole     a frame is one write
    mark      the data is full of headers            plain     the data is a ramp
    wrong     the next frame has a wrong checksum    lose      the next frame lacks a byte
    mixed     the words of the next frame are one byte off, and its checksum is right
    extra     the next frame has a byte too many     garbage   text stands before the next frame
    fault     an error with a text is sent           silence   no frames are sent; `speak` ends it
    half      half a frame is sent, and the device is unplugged
    unplug    the terminal is closed                 replug    a new one is opened behind the same link; with a word,
                                                               it has another serial number
    ask TAG   prints TAG, and how many frames have gone out

The cells of a frame are a ramp, (base + i) modulo 4096 for tactel i, so a frame that is mixed up shows.
"""

import argparse
import json
import os
import pty
import select
import sys
import time
import tty

BLOCK = [[208, 224, 32, 0], [192, 48, 16, 64], [176, 144, 112, 80], [160, 240, 128, 96]]


def xor(data):
    total = 0
    for byte in data:
        total ^= byte
    return total


def sealed(body):
    message = bytes([0xF0, 0xC4]) + bytes(body)
    return message + bytes([xor(message)])


def myrmex(base, is_mark):
    words = [0] * 256
    for row in range(16):
        for col in range(16):
            word = BLOCK[row % 4][col % 4] + 4 * (row // 4) + col // 4
            reading = 0x4F0 if is_mark else (base + 16 * row + col) % 4096
            words[word] = ((word // 16) << 12) | reading
    if is_mark:
        # F0 C4 in every word: the channel C, and the reading 4F0.
        words = [0xC4F0] * 256
    return b"".join(word.to_bytes(2, "little") for word in words)


def glove(base):
    taxels = [(i * 5) % 64 for i in range(64)]
    return b"".join(bytes([i]) + ((base + i) % 4096).to_bytes(2, "little") for i in taxels)


class Device:
    def __init__(self, options):
        self.options = options
        self.sensors = [int(length) for length in options.sensors.split(",")]
        self.master = None
        self.slave = None
        self.is_split = self.is_mark = self.is_silent = False
        self.next_fault = None
        self.frames = 0
        self.plug()

    def plug(self):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        new = self.options.link + ".new"
        os.symlink(os.ttyname(self.slave), new)
        os.rename(new, self.options.link)
        self.inbox = b""
        self.is_started = False
        self.has_heard = False

    def unplug(self):
        os.unlink(self.options.link)
        os.close(self.master)
        os.close(self.slave)
        self.master = None

    def write(self, data):
        pieces = [data[i : i + 1] for i in range(len(data))] if self.is_split else [data]
        for piece in pieces:
            try:
                os.write(self.master, piece)
            except BlockingIOError:
                # Nobody reads: what does not fit is lost, as in a real device.
                return

    def read(self):
        try:
            self.inbox += os.read(self.master, 4096)
        except (BlockingIOError, OSError):
            return
        while True:
            at = self.inbox.find(b"\xf0\xc4")
            if at < 0 or len(self.inbox) < at + 5:
                return
            length = 9 if self.inbox[at + 3] == 0xD0 else 5
            if len(self.inbox) < at + length:
                return
            self.obey(self.inbox[at : at + length])
            self.inbox = self.inbox[at + length :]

    def obey(self, message):
        self.has_heard = True
        print(json.dumps({"got": message.hex().upper()}), flush=True)
        if xor(message) != 0:
            self.write(sealed([0xFE, 0xF0]))
            return
        command = message[3]
        if command == 0x00:
            self.is_started = False
        elif command == 0xC0:
            body = [0x00, 0x01, 0x02, len(self.sensors)]
            for i, length in enumerate(self.sensors):
                body += [0x34 + i, 0x12, length % 256, length // 256]
            self.write(sealed(body))
        elif command == 0xC1:
            self.write(sealed([0xF1, 0x12, 2, 7, 8, 0]))
        elif command == 0xC2 and self.options.serial:
            self.write(sealed([0xF2, len(self.options.serial)] + list(self.options.serial.encode())))
        elif command == 0xF1:
            self.is_started = True

    def frame(self, sensor, length):
        base = (37 * self.frames) % 3000
        data = myrmex(base, self.is_mark) if length == 512 else glove(base)
        # The unit of the stamps is 0.1 ms.
        stamp = int(time.monotonic() * 1e4) % (1 << 32)
        return sealed(bytes([sensor]) + stamp.to_bytes(4, "little") + data)

    def send(self):
        for i, length in enumerate(self.sensors):
            frame = bytearray(self.frame(i + 1, length))
            if self.next_fault == "wrong":
                frame[-1] ^= 0x55
            elif self.next_fault == "lose":
                del frame[len(frame) // 2]
            elif self.next_fault == "extra":
                frame.insert(len(frame) // 3, 0xF0)
            elif self.next_fault == "mixed":
                frame = bytearray(sealed(frame[2:7] + frame[8:-1] + frame[7:8]))
            elif self.next_fault == "garbage":
                frame = bytearray(b"\xf0 1: start\r\n2: stop\xf0\xc4\xc9\r\n") + frame
            elif self.next_fault == "fault":
                self.write(sealed([0xFE, 3] + list(b"hot")))
            elif self.next_fault == "half":
                self.write(bytes(frame[: len(frame) // 2]))
                time.sleep(0.05)
                self.unplug()
            self.next_fault = None
            if self.master is None:
                return
            self.write(bytes(frame))
        self.frames += 1

    def order(self, line):
        words = line.split()
        if words[0] in ("split", "whole"):
            self.is_split = words[0] == "split"
        elif words[0] in ("mark", "plain"):
            self.is_mark = words[0] == "mark"
        elif words[0] in ("silence", "speak"):
            self.is_silent = words[0] == "silence"
        elif words[0] == "unplug":
            self.unplug()
        elif words[0] == "replug":
            self.options.serial = words[1] if len(words) > 1 else self.options.serial
            self.plug()
        elif words[0] == "ask":
            print(json.dumps({"tag": words[1], "frames": self.frames, "is_started": self.is_started}), flush=True)
        else:
            self.next_fault = words[0]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("link")
    parser.add_argument("--sensors", default="512")
    parser.add_argument("--serial", default="")
    parser.add_argument("--help-text", action="store_true")
    parser.add_argument("--period", type=float, default=0.005)
    device = Device(parser.parse_args())
    print(json.dumps({"ready": device.options.link}), flush=True)
    orders, due, help_due = b"", time.monotonic(), time.monotonic()
    while True:
        now = time.monotonic()
        files = [sys.stdin.fileno()] + ([device.master] if device.master is not None else [])
        ready, _, _ = select.select(files, [], [], max(0.0, min(due - now, 0.02)))
        if sys.stdin.fileno() in ready:
            data = os.read(sys.stdin.fileno(), 4096)
            if not data:
                return
            orders += data
            while b"\n" in orders:
                line, orders = orders.split(b"\n", 1)
                device.order(line.decode())
        if device.master is None:
            continue
        device.read()
        if device.options.help_text and not device.has_heard and time.monotonic() >= help_due:
            device.write(b"0: print this help\r\n")
            help_due = time.monotonic() + 1.0
        if time.monotonic() >= due:
            due = max(due + device.options.period, time.monotonic() - 0.05)
            if device.is_started and not device.is_silent:
                device.send()


main()
