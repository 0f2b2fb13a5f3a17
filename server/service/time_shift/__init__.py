"""Time shift (DVR): playback of past streams, from the recording on the disk and from memory."""
