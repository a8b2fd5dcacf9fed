"""The nominal model in a few coordinates, what effects change in it, and what its owner cannot know about it."""
