"""The Rerun recording and its viewers."""
