"""First poles, from a stabilisation diagram."""
