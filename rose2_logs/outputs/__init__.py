"""The output formats for people and programs; no output depends on another."""
