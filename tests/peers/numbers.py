"""A sensor in another process: sends a number a line, falls silent, then says a last word or hangs up."""

import socket
import sys
import time

count, interval_s, silence_s, last_word = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
with socket.create_server(("127.0.0.1", 0)) as server:
    print(server.getsockname()[1], flush=True)
    connection, _ = server.accept()
    with connection:
        for i in range(count):
            connection.sendall(b"%d\n" % i)
            time.sleep(interval_s)
        time.sleep(silence_s)
        if last_word != "hang-up":
            connection.sendall(last_word.encode() + b"\n")
            time.sleep(5.0)
