"""The form of several segments: second order where it holds, the full equations where it does not."""
