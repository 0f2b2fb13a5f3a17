"""Fuzzing of the pulse protocol: lines, sessions without sockets, and real sockets."""
