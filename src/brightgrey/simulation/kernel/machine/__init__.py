"""The machine beneath the kernel: compilation, vector registers, and the layout of tables in memory."""
