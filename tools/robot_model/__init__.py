"""What the generators of robot models share: shapes, pads, looks, SDF and OBJ text."""
