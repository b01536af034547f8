"""Ground floor: errors, frames, documents and grasp sets. Nothing here imports pydrake."""
