"""How a camera sheds load on a busy machine."""
