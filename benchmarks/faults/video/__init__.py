"""Videos, network cameras and detections whose every picture carries its camera and frame number."""
