"""The Pioneer family of robots, firmware P2OS, AROS and ARCOS: its wire format, its driver and an emulated robot."""
