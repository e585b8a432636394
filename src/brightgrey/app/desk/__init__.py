"""The desk: a process beside the server that reads recordings and results, so that the pages never wait for it."""
