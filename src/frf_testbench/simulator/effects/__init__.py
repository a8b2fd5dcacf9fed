"""What a nominal model may lack: the effects of the contract, and others outside it."""
