"""What is selected and on screen, as parameters."""
