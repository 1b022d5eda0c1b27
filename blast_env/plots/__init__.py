"""Pictures of blasts: frames, a window, films and figures; needs the extra `render`."""
