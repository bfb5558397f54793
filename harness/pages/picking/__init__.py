"""Pages of `pick`: how good its choices are, and what the errors that runs state are worth."""
