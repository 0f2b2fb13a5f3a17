"""The sites that faults are injected into."""
