"""Neural detectors that can be installed: where they come from, and their conversion to ONNX."""
