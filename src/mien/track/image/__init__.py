"""What is compared: the drawing, the frame, and the filters of both."""
