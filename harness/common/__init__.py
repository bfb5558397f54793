"""Tools of every room of the harness: text, files, cache, machine, worker, timing, store; imports `solvers`."""
