"""Fault injection: processes, sources, messages, disk and clock fail while viewers watch."""
