"""Pages and pictures for the person at the robot: the trial protocol and the lab page."""
