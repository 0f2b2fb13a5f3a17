"""Processes, sources, messages, disk and clock fail while viewers watch: what each promise is worth."""
