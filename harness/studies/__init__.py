"""A study file, its cases, and their measured records, with the study files; imports `references`."""
