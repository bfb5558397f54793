"""The form averaged to second order and its tables; imports `models`, `forms` and `free_top`."""
