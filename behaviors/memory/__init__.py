"""What a drive keeps from one cycle to the next: its progress, its last turn, echoes on its way."""
