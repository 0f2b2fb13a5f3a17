"""The pulse protocol: its lines, whole sessions without sockets, and over real ones."""
