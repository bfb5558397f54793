"""The form of several pieces: second order where it holds, the full equations where it does not."""
