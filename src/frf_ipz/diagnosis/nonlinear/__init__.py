"""What is not linear: the gate that sees it, the law and its place, and the model that has it."""
