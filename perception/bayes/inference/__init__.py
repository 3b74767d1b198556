"""What every explanation shares: likelihood of a range, noise, prediction, and which readings are kept and count."""
