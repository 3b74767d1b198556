"""The Denning MRV-III of PROTOCOL.md: its wire format, its driver and an emulated robot."""
