from .scene_export import export_scene as export_scene
