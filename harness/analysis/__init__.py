"""Numbers from records: fronts, winners, the regime map, outcomes; imports `studies`."""
