"""What is drawn of each study."""
