"""A program: it is ready at once, and sends back what comes, until its line is closed."""

from __future__ import annotations

import socket
import sys

if __name__ == "__main__":
    line = socket.socket(fileno=int(sys.argv[1]))
    line.sendall(b"ready\n")
    while data := line.recv(100):
        line.sendall(data)
