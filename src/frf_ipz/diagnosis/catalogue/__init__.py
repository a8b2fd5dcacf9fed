"""Effects that a nominal model may lack: each one a module, found by itself."""
