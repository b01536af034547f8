"""Pictures of a printed board in a room, made another way, to judge those who find it.

It shares no code with what it judges: nothing of this project but the command that writes the PDF,
and nothing of `cv2.aruco`. `paper` rasterises the PDF's pages, `sheet` glues them with errors and
bends them, `lens` and `views` are the camera and where it stands, `light` has lamps and shadows,
`covers` hands and what else lies on the board, `exposure` integrates light over pixels and time,
`sensor` makes an image of it, and `rows` names conditions. `objects` traces rays to meshes on the
board, and `placed` takes photos of objects that stand off their places. All lengths are in metres,
in the scene frame S: lower left corner of the board, x right, y up, z out of the sheet. The middle
of a pixel is at whole numbers.
"""
