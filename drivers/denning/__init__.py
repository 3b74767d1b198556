"""The Denning MRV-III of PROTOCOL.md: its wire format and the robot on top of it."""
