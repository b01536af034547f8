"""Whether the arm can bring the hand to a grasp."""
