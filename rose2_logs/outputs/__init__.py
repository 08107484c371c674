"""What a run becomes for people and programs; no output knows another."""
