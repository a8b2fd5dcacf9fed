"""Whether the result of a run can be used, from checks with a figure, a limit, a place and advice each."""
