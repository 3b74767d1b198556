"""The operator console: one page, served by the robot's own process, to see, handle and drive.

A cycle leaves a note that it is over and goes on; what the page needs is put together afterwards, once for all
clients, and each client has one slot for the newest of it and one task that sends. So neither a slow client nor a
hostile one is ever waited for. Whatever a client asks for becomes an input of the next cycle; only a HALT goes out at
once.
"""
