"""Numbers from records: fronts, winners, the regime map, two runs compared; imports `references`."""
