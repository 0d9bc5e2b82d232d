"""A subject through time: tracking, joint angles, export, evaluation."""
