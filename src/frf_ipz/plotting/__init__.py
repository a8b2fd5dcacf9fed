"""Pictures for publications: one function a picture, results in, Matplotlib axes out."""
