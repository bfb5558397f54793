"""The offline web site, made of the pages and their data; imports `pages` and `paper`."""
