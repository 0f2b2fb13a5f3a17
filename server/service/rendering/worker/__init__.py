"""Pictures out of streams: decode, draw boxes, encode again. A process of its own, started on demand."""
