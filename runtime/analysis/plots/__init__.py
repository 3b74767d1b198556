"""Pictures of a run as the paper draws them; the only place that knows matplotlib."""
