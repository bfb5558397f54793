"""One module or folder per section of the paper; imports `paper`."""
