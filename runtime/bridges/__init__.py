"""Bridges to other programs, each in a process of its own: clients of the console's protocol, like a page."""
