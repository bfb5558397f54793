"""The commands of `polhode`, one module each, imported on use."""
