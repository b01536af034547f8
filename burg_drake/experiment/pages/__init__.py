"""Pages for the lab: the protocol of trials on paper, and pictures of their grasps."""
