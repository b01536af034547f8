from .page import comparison_page as comparison_page
