"""What every room of the harness uses: text, files, cache, machine, worker, timing, store; imports `solvers`."""
