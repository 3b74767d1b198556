"""The commands that find, test, measure and build a robot of one's own."""
