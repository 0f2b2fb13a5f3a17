"""Time shift (DVR): playing what was streamed before, from the recording on the disk and from memory."""
