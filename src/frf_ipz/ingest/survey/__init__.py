"""The first look at recordings: where the blows are, what is wrong with each, what is used and how."""
