"""Far from the axis, where no peak is narrow: wide search, and the way back."""
