"""What of the skin the sensors see, and which point of the cloud belongs to which vertex (paper, section 3.3)."""
