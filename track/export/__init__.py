"""Subjects and motions as files that other tools read."""
