"""Search of the recorded decisions: who stayed where, and when, by a separate process."""
