"""Numbers from records: fronts, winners, the regime map, runs compared; imports `references`."""
