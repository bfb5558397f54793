"""The form averaged to second order and its tables; imports `models` and `forms`, and on use the solver of `path`."""
