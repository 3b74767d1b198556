"""Detection of sensors that lie one by one: stuck, failing, silent and cross-talking ones are found and masked."""
