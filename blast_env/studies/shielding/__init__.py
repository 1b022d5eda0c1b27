"""How much of a blast goes round the corners of a block."""
