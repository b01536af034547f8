"""One module a format of grasps; its `FORMAT` is listed in `formats.grasp_files`.

Read `acronym` as an example.
"""
