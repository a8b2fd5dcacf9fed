"""What a user most likely has to correct, from a comparison of measured and computed modes under each mistake."""
