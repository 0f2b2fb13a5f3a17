"""The render worker, a process started on demand: decodes streams, draws boxes, encodes pictures."""
