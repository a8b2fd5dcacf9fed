"""What explains a test as well as the best that a search came to, or nearly."""
