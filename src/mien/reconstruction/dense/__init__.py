"""Dense registration: the photos aligned with each other through the head's surface.

Landmarks slide over the face with the view; skin does not. Every patch of skin that two photos
show tells the cameras and the shape (docs/method/registration.md).
"""
