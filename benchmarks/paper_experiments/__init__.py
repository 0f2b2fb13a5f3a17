"""The paper's experiments again, on drawn scenes."""
