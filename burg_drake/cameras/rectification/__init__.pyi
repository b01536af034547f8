from .top_view import (
    BoardPicture as BoardPicture,
    BoardRectifier as BoardRectifier,
    board_picture as board_picture,
)
