"""The paper's experiments, repeated on synthetic scenes."""
