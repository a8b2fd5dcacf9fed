"""The first pass over recordings: where the impacts are, what is wrong with each record, what is used and how."""
