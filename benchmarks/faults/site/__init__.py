"""The sites that faults are injected into: local processes, containers, and a lossy bus."""
