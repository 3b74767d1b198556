"""What a user would pick instead, measured on the same readings: `make bench`. No test is collected here."""
