"""What is played with in the chapters, one class a chapter or kind of them."""
