"""One updating method a module: ``update(problem, options, progress)``; its name is the module's, with hyphens."""
