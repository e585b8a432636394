"""The app: a browser page over the command line, from a file to a handed-over model. It needs the extra `app`."""
