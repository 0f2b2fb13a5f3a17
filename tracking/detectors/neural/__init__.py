"""Neural detectors, run by onnxruntime."""
