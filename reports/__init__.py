"""What a run shows: metrics, the drift gate, the recording."""
