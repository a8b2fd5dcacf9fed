"""The effects that a nominal model may lack, each a module."""
